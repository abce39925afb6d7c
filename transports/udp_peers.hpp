// SPDX-License-Identifier: GPL-3.0-or-later
// Numbers for the hosts that have sent to a board's UDP socket.
//
// A bounded table: a new sender takes the place of the one that has been silent longest, or, while
// all have been heard within `idle`, of the one heard least often; so a flood from changing
// addresses pushes no working host out. A number is never given twice.
#pragma once

#include <array>
#include <asio/ip/udp.hpp>
#include <chrono>
#include <cstddef>
#include <cstdint>

#include "carrier.hpp"

namespace r4 {

class UdpPeers {
 public:
  using Endpoint = asio::ip::udp::endpoint;
  using Time = std::chrono::steady_clock::time_point;
  static constexpr std::size_t capacity = 16;
  static constexpr std::chrono::seconds idle{2};

  // The number of a sender that has just been heard.
  Peer heard(const Endpoint& from, Time now);
  // Where that number sends from; null if it is not in the table any more.
  const Endpoint* find(Peer number) const;

 private:
  struct Entry {
    Endpoint endpoint;
    Peer number = everyone;  // everyone: free
    Time heard{};
    std::uint64_t datagrams = 0;
  };

  Entry& place_for_new(Time now);

  std::array<Entry, capacity> entries_;
  Peer given_ = 0;
};

}  // namespace r4
