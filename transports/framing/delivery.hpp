// SPDX-License-Identifier: GPL-3.0-or-later
// How a datagram is to be delivered: to whom, and what becomes of it where there is no room.
#pragma once

#include <cstdint>

namespace r4 {

// Who is at the other end, where several can be (hosts at a board's UDP socket). A transport hands a
// number out for each sender of a valid datagram; `everyone` is its standing audience, and whoever
// sent what is none.
using Peer = std::uint32_t;
constexpr Peer everyone = 0;

// What a full queue does with a datagram.
enum class Priority : std::uint8_t {
  state,   // newest wins: an older waiting state is replaced
  normal,  // waits its turn; refused when the queue is full
  stop,    // overtakes everything and is never dropped
};

}  // namespace r4
