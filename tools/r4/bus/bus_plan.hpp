// SPDX-License-Identifier: GPL-3.0-or-later
// The load of a planned CAN bus, from the bits of all frames of the link.
// Average: typical datagrams of driving boards. Worst: the longest datagrams with most stuff bits.
#pragma once

#include <cstdint>
#include <vector>

#include "r4link/can/can_bits.hpp"
#include "r4link/state.hpp"

namespace r4::tool {

struct BusPlan {
  std::uint32_t boards = 8;       // at most can_nodes
  std::uint32_t states_hz = 100;  // per board, like all rates
  std::uint32_t commands_hz = 20;
  FieldSet fields;
  CanBitRate bit_rate{1000000, 0};  // a data rate selects FD frames of 64 bytes
  bool packed = true;
};

// Sent by the link itself (docs/reference/protocol.md).
constexpr std::uint32_t board_heartbeats_hz = 2;
constexpr std::uint32_t host_heartbeats_hz = 10;

struct BusTraffic {
  const char* name;
  double datagrams = 0;  // per second
  double bytes = 0;      // average size of one datagram on the bus
  double frames = 0;     // per second, including flow control
  double bits = 0;       // per second
  double load = 0;       // fraction of the bus's time, 1: full
  double worst_load = 0;
};

struct BusLoad {
  std::vector<BusTraffic> traffic;
  BusTraffic total{"total"};
};

BusLoad load_of(const BusPlan& plan);

// The most boards, or the highest rate of states, with an average load up to `limit`; 0: none.
std::uint32_t most_boards(BusPlan plan, double limit);
std::uint32_t highest_rate(BusPlan plan, double limit);

}  // namespace r4::tool
