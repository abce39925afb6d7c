// SPDX-License-Identifier: GPL-3.0-or-later
// Distinguishes lost, duplicate, reordered and restarted packet numbers (paper section 4.1: PNum).
// Packet numbers are unsigned, 32 bit, and wrap (RFC 1982). The tracker remembers the last 64
// numbers. A late packet is subtracted from the lost packets. A number further back is old. If the
// successor of an old number arrives next, the sender has restarted (RFC 3550 A.1).
#pragma once

#include <cstdint>

#include "../config.hpp"
#include "../vocabulary.hpp"

namespace r4 {

enum class Arrival : std::uint8_t {
  first,
  next,  // the expected number
  gap,   // newer than expected: the skipped numbers count as lost
  duplicate,
  late,  // fills a gap: subtracted from the lost packets
  old,   // too far back to be late or duplicate, or older than the first
  restart,
};

// True if the packet is the newest so far.
constexpr bool is_current(Arrival arrival) {
  return arrival == Arrival::first || arrival == Arrival::next || arrival == Arrival::gap ||
         arrival == Arrival::restart;
}

class R4LINK_API PacketTracker {
 public:
  Arrival on(std::uint32_t pnum);
  // The sender has restarted: the next number counts as its first.
  void restart();

  std::uint32_t newest() const { return newest_; }
  bool started() const { return started_; }
  const PacketCounters& counters() const { return counters_; }

  static constexpr std::uint32_t window = 64;
  // A number further ahead is old, too.
  static constexpr std::uint32_t max_gap = 65536;

 private:
  PacketCounters counters_;
  std::uint64_t seen_ = 0;  // bit i: newest_ - i was seen
  std::uint32_t newest_ = 0;
  std::uint32_t reach_ = 0;    // how far back seen_ is valid
  std::uint32_t suspect_ = 0;  // this number would confirm a restart
  bool started_ = false;
  bool suspecting_ = false;
};

}  // namespace r4
