// SPDX-License-Identifier: GPL-3.0-or-later
// Datagrams that the system does not take at the moment, in the order in which they should go.
//
//     stop    first of all; never expires; of more than 8 the oldest makes room
//     normal  in order; refused when the lane is full
//     state   last; newest wins: when the lane is full, the oldest makes room
//
// Each entry but a stop expires 100 ms after it came. Bounded. Hardly ever does anything wait, and of many
// boards each has a queue: a lane takes all its memory when something waits in it for the first time.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "r4link/carrier.hpp"
#include "r4link/datagram.hpp"

namespace r4 {

class SendQueue {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr std::chrono::milliseconds lifetime{100};

  struct Entry {
    Time expires;
    Peer to = everyone;
    Priority priority = Priority::normal;
    std::uint16_t size = 0;
    char bytes[max_datagram];

    std::string_view text() const { return {bytes, size}; }
  };

  // Datagrams that are dropped are added to `dropped`.
  SendQueue(std::size_t normal, std::size_t states, std::uint64_t& dropped);

  // `sent` if it waits now, else `full`. `bytes` must be at most max_datagram long.
  SendResult push(std::string_view bytes, Priority priority, Peer to, Time now);

  // The one to send next, or null. Drops what has expired.
  const Entry* front(Time now);
  // Removes the one that front() gave.
  void pop();

  bool empty() const;
  // Drops everything.
  void clear();

 private:
  // A ring of entries, oldest first.
  struct Lane {
    explicit Lane(std::size_t most) : capacity(most) {}
    std::size_t capacity;
    std::vector<Entry> entries;  // none yet, or `capacity`
    std::size_t first = 0;
    std::size_t count = 0;
    void pop();
  };

  Lane stop_, normal_, state_;
  Lane* front_ = nullptr;  // the lane of front()
  std::uint64_t& dropped_;
};

}  // namespace r4
