// SPDX-License-Identifier: GPL-3.0-or-later
// Datagrams that the system cannot take yet, in the order of sending:
//     stop    first; never expires; the ninth replaces the oldest
//     normal  in order; refused when the lane is full
//     state   last; newest wins: when the lane is full, a new state replaces the oldest
// Entries other than stops expire after 100 ms. A lane has no memory before its first entry.
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

  SendQueue(std::size_t normal, std::size_t states, std::uint64_t& dropped);

  // Returns `sent` if the datagram waits now, else `full`. `bytes`: at most max_datagram long.
  SendResult push(std::string_view bytes, Priority priority, Peer to, Time now);

  // The entry to send next, or null. Drops expired entries.
  const Entry* front(Time now);
  void pop();

  bool empty() const;
  void clear();

 private:
  // A ring of entries, oldest first.
  struct Lane {
    explicit Lane(std::size_t most) : capacity(most) {}
    std::size_t capacity;
    std::vector<Entry> entries;  // empty until the first datagram, then `capacity` entries
    std::size_t first = 0;
    std::size_t count = 0;
    void pop();
  };

  Lane stop_, normal_, state_;
  Lane* front_ = nullptr;  // the lane of front()
  std::uint64_t& dropped_;
};

}  // namespace r4
