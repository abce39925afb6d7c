// SPDX-License-Identifier: GPL-3.0-or-later
// Distinguishes lost, duplicate, reordered and restarted packet numbers (paper section 4.1: PNum).
// Packet numbers are unsigned, 32 bit, and wrap (RFC 1982). The last 64 are remembered, so a late
// packet differs from a duplicate, and is subtracted from the lost ones. A number further back is
// old. If two old numbers in a row rise, the sender has restarted (as in RFC 3550 A.1).
#pragma once

#include <cstdint>

#include "../config.hpp"
#include "../vocabulary.hpp"

namespace r4 {

enum class Arrival : std::uint8_t {
  first,      // nothing to compare with
  next,       // the expected number
  gap,        // newer than expected: the numbers between count as lost
  duplicate,  // seen before
  late,       // counted as lost before; subtracted from it
  old,        // too far back to be late or duplicate, or from before the first
  restart,    // the sender restarted
};

// True if the packet is the newest so far. The content of an older packet is outdated.
constexpr bool is_current(Arrival arrival) {
  return arrival == Arrival::first || arrival == Arrival::next || arrival == Arrival::gap ||
         arrival == Arrival::restart;
}

class R4LINK_API PacketTracker {
 public:
  Arrival on(std::uint32_t pnum);
  // The sender has restarted: the next number is its first.
  void restart();

  std::uint32_t newest() const { return newest_; }
  bool started() const { return started_; }
  const PacketCounters& counters() const { return counters_; }

  static constexpr std::uint32_t window = 64;
  // A larger jump ahead is a restart, not a loss.
  static constexpr std::uint32_t max_gap = 65536;

 private:
  PacketCounters counters_;
  std::uint64_t seen_ = 0;  // bit i: newest_ - i was seen
  std::uint32_t newest_ = 0;
  std::uint32_t reach_ = 0;    // how far back seen_ goes: not before the first number
  std::uint32_t suspect_ = 0;  // the number that would confirm a restart
  bool started_ = false;
  bool suspecting_ = false;
};

}  // namespace r4
