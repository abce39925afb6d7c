// SPDX-License-Identifier: GPL-3.0-or-later
// On the bus, a stop of this host has a number of 18 bits instead of its packet number of 32 bits.
// A board reports the short number in the field STOP. Like a session, keeps the newest 16 stops.
#pragma once

#include <cstddef>
#include <cstdint>

#include "r4link/datagram.hpp"
#include "r4link/text.hpp"

namespace r4 {

class StopNumbers {
 public:
  static constexpr std::size_t most = 16;

  // The bus carries the stop `pnum` under the number `carried`.
  void add(std::uint32_t pnum, std::uint32_t carried);
  bool find(std::uint32_t pnum, std::uint32_t& carried) const;
  bool carries(std::uint32_t carried) const { return stop_of(carried) != nullptr; }

  // In a heartbeat that reports one of these stops, replaces the number by the packet number. The
  // result is written to `room` (max_datagram bytes). Returns any other datagram unchanged.
  Text in_full(Text datagram, char* room) const;

 private:
  struct Stop {
    std::uint32_t pnum = 0;
    std::uint32_t carried = 0;
  };
  const Stop* stop_of(std::uint32_t carried) const;

  Stop stops_[most];
  std::size_t count_ = 0;
  std::size_t next_ = 0;
};

}  // namespace r4
