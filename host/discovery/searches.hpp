// SPDX-License-Identifier: GPL-3.0-or-later
// The search of each transport, for discover() (r4link/discovery/discover.hpp). Each blocks, and
// returns the boards and the places of its transport.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "r4link/discovery/discover.hpp"

namespace r4 {

// How a board on a serial port or a CAN bus is asked who it is.
constexpr std::chrono::milliseconds between_questions{150};
constexpr int most_questions = 3;

// `besides`: the paths of ports to ask whatever their USB id is. Takes 1.3 s at most.
Discovery search_serial_ports(const std::vector<std::string>& besides);
// Takes 0.7 s, and 1.3 s if a board that was heard has not said who it is.
Discovery search_can_interfaces();
// Takes 0.5 s.
Discovery search_networks(std::uint16_t port);

}  // namespace r4
