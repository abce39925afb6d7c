// SPDX-License-Identifier: GPL-3.0-or-later
// The CAN interfaces for r4 list, and the boards on them.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "listed_board.hpp"
#include "transports/can/can_interface.hpp"

namespace r4::tool {

struct ListedBus {
  CanInterface interface;
  std::map<std::uint8_t, ListedBoard> boards;  // by their nodes
  std::string trouble;                         // why nothing could be heard
  std::string fix;
};

// Listens for boards for 0.7 s, and for 1.3 s where one has not told who it is. A board without a host is asked
// three times at most, as a host sends that comes to the bus; of one that has a host, it hears what that one asks.
std::vector<ListedBus> list_buses();

void print_text(const std::vector<ListedBus>& buses);
void print_json(const std::vector<ListedBus>& buses);

}  // namespace r4::tool
