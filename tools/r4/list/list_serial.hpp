// SPDX-License-Identifier: GPL-3.0-or-later
// The serial ports for r4 list, and the boards at them.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "listed_board.hpp"
#include "r4link/error.hpp"
#include "transports/serial/port_list.hpp"

namespace r4::tool {

struct ListedPort {
  SerialPort port;
  bool asked = false;              // it is a board's, or a program of ours has it
  ListedBoard board;               // where it was asked
  std::optional<Problem> trouble;  // why it could not be
};

// Asks at each port that has the USB id of a board, and at those of `besides`, who is there: `Q:ID`, three times at
// most. Where a program of this machine has a port open, it listens beside it instead, for what that one asks. Takes
// 1.3 s at most. A program that wants a port meanwhile gets it.
std::vector<ListedPort> list_ports(const std::vector<std::string>& besides);

void print_text(const std::vector<ListedPort>& ports);
void print_json(const std::vector<ListedPort>& ports);

}  // namespace r4::tool
