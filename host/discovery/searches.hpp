// SPDX-License-Identifier: GPL-3.0-or-later
// The search of each transport for discover(). Each search blocks, then returns boards and places.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "r4link/discovery/discover.hpp"

namespace r4 {

constexpr std::chrono::milliseconds between_questions{150};
constexpr int most_questions = 3;

// Sends Q:ID to ports with a board's USB id, and to `besides` with any USB id, in at most 1.3 s.
Discovery search_serial_ports(const std::vector<std::string>& besides);
// Takes 0.7 s. If a board sends datagrams but no answer: 1.3 s.
Discovery search_can_interfaces();
Discovery search_networks(std::uint16_t port);  // takes 0.5 s

}  // namespace r4
