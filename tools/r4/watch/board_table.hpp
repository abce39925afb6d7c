// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "../boards/board_set.hpp"
#include "../shell/output.hpp"
#include "../shell/screen.hpp"
#include "monitor_view.hpp"

namespace r4::tool {

class BoardTable {
 public:
  // `live`: redraw the table in place on a terminal; else print its rows to `lines` repeatedly.
  BoardTable(const BoardSet& boards, bool live, LineWriter& lines)
      : boards_(boards), live_(live), lines_(lines), notes_(boards.size()) {}

  // Records transport problems of that board in the table, which must outlive the view.
  std::unique_ptr<MonitorView> view(std::size_t board);
  void show();

 private:
  std::vector<std::string> rows() const;

  const BoardSet& boards_;
  const bool live_;
  LineWriter& lines_;
  Screen screen_;
  std::vector<std::string> notes_;
};

}  // namespace r4::tool
