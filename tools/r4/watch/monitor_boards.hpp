// SPDX-License-Identifier: GPL-3.0-or-later
// `r4 monitor` of several boards, by URLs or a pattern: a table, or the JSON of each.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "../shell/options.hpp"
#include "r4link/options.hpp"

namespace r4::tool {

struct BoardsMonitorOptions {
  std::vector<std::string> urls;
  BoardOptions board;
  bool json = false;
  std::uint64_t count = 0;  // states of all boards together; 0: no end
  std::optional<Milliseconds> duration;
};

// Runs until its end or a signal. Throws Error, refused if a board was not heard.
void monitor_boards(const BoardsMonitorOptions& options);

}  // namespace r4::tool
