// SPDX-License-Identifier: GPL-3.0-or-later
// The numbers of one host's stops on a bus: 18 bits, which a board reports in the heartbeat field
// STOP, for the packet number of 32 bits. Keeps the newest 16, as many as a session repeats.
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
  // Sets `carried` to the stop's number on the bus. False if the stop is not known.
  bool find(std::uint32_t pnum, std::uint32_t& carried) const;
  // True if the bus carries a stop of this host under that number.
  bool carries(std::uint32_t carried) const { return stop_of(carried) != nullptr; }

  // A heartbeat that reports one of these stops, with its packet number, written to `room`
  // (max_datagram bytes). Any other datagram is returned unchanged.
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
