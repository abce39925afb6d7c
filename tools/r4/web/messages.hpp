// SPDX-License-Identifier: GPL-3.0-or-later
// JSON messages from r4 web to pages (docs/how-to/web.md).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "columns.hpp"
#include "web_board.hpp"

namespace r4::tool::web {

struct Row {
  std::int64_t time_ms = 0;    // since 1970
  std::uint64_t board_ms = 0;  // T; equal for all parts of one state
  std::vector<double> values;
};

// The newest 64 rows of a board that have not been sent to pages.
class Rows {
 public:
  explicit Rows(const Columns& columns) : columns_(columns) {}
  void add(const Datagram& state, std::int64_t time_ms);
  bool empty() const { return rows_.empty(); }
  // Appends [[time,value,…],…] and clears the rows. Unknown values are null.
  void take(std::string& out);

 private:
  const Columns& columns_;
  std::vector<Row> rows_;
};

std::string hello_text(const Columns& columns, const std::vector<WebBoard*>& boards,
                       std::uint32_t you, std::int64_t clock_ms);
std::string board_text(std::size_t number, WebBoard& slot);
std::string event_text(std::size_t board, WebBoard::Level level, const std::string& text,
                       std::int64_t time_ms);
std::string result_text(std::uint64_t request, std::size_t board, bool ok, double ms,
                        const std::string& text);
std::string error_text(const std::string& text);

}  // namespace r4::tool::web
