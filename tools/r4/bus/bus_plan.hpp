// SPDX-License-Identifier: GPL-3.0-or-later
// The load of a CAN bus that is only planned: every datagram of the link is written, packed unless it
// shall be plain, cut into frames, and the bits of the frames are counted.
//
// Average: datagrams of boards that drive, bit by bit. Worst: the longest that each can get, and as
// many stuff bits as its frames can have; a bus that has room for that is never late for its load.
#pragma once

#include <cstdint>
#include <vector>

#include "r4link/can/can_bits.hpp"
#include "r4link/state.hpp"

namespace r4::tool {

struct BusPlan {
  std::uint32_t boards = 8;       // at most can_nodes
  std::uint32_t states_hz = 100;  // of each board; so are the others
  std::uint32_t commands_hz = 20;
  FieldSet fields;                  // not empty
  CanBitRate bit_rate{1000000, 0};  // with a data rate the frames are FD frames of 64 bytes
  bool packed = true;
};

// What the link adds by itself (docs/protocol.md).
constexpr std::uint32_t board_heartbeats_hz = 2;
constexpr std::uint32_t host_heartbeats_hz = 10;

// One kind of traffic of all boards together.
struct BusTraffic {
  const char* name;
  double datagrams = 0;  // a second
  double bytes = 0;      // of one, as it travels; average
  double frames = 0;     // a second, those of flow control included
  double bits = 0;       // a second
  double load = 0;       // of the bus's time: 1 is all
  double worst_load = 0;
};

struct BusLoad {
  std::vector<BusTraffic> traffic;
  BusTraffic total{"total"};
};

BusLoad load_of(const BusPlan& plan);

// The most boards, and the highest rate of states, whose average load is at most `limit`; 0: none.
std::uint32_t most_boards(BusPlan plan, double limit);
std::uint32_t highest_rate(BusPlan plan, double limit);

}  // namespace r4::tool
