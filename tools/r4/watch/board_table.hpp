// SPDX-License-Identifier: GPL-3.0-or-later
// `r4 monitor` of several boards for people: a table, a row for each board.
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
  // `live`: redrawn in place, on a terminal. Else its rows go to `lines`, again and again.
  BoardTable(const BoardSet& boards, bool live, LineWriter& lines)
      : boards_(boards), live_(live), lines_(lines), notes_(boards.size()) {}

  // Keeps in the table what is wrong with the transport of that board. The table outlives it.
  std::unique_ptr<MonitorView> view(std::size_t board);
  void show();

 private:
  std::vector<std::string> rows() const;

  const BoardSet& boards_;
  const bool live_;
  LineWriter& lines_;
  Screen screen_;
  std::vector<std::string> notes_;  // of the boards' transports
};

}  // namespace r4::tool
