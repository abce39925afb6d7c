// SPDX-License-Identifier: GPL-3.0-or-later
// The numbers by which a bus carries the stops of one host. A stop is confirmed by its packet
// number, which has 32 bits; the frame on the bus carries a number of 18 bits, which a board tells
// in the field STOP of its heartbeats. Here a heartbeat that was heard gets back the number that
// the host knows.
//
// The newest 16 stops are known, as many as a session repeats at a time.
#pragma once

#include <cstddef>
#include <cstdint>

#include "r4link/datagram.hpp"
#include "r4link/text.hpp"

namespace r4 {

class StopNumbers {
 public:
  static constexpr std::size_t most = 16;

  // The bus carries the stop `pnum` by the number `carried`.
  void add(std::uint32_t pnum, std::uint32_t carried);
  // The number by which the bus carries that stop. False: it is new, or forgotten.
  bool find(std::uint32_t pnum, std::uint32_t& carried) const;
  // True if it carries a stop of this host by that number.
  bool carries(std::uint32_t carried) const { return stop_of(carried) != nullptr; }

  // A heartbeat that tells of one of these stops, with the number that the host knows, written to
  // `room` of max_datagram bytes. Any other datagram as it is.
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
