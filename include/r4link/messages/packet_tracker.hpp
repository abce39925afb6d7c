// SPDX-License-Identifier: GPL-3.0-or-later
// Tells lost, duplicate, reordered and restarted packet numbers apart (paper section 4.1: PNum).
//
// Packet numbers are unsigned 32 bit and wrap (RFC 1982).
// The last 64 numbers are remembered, so a late packet is told from a repeated one and takes its
// loss back. A number that is further behind is old news, until two old ones in a row rise: then
// the sender has restarted (the rule of RFC 3550 A.1).
#pragma once

#include <cstdint>

#include "../config.hpp"
#include "../vocabulary.hpp"

namespace r4 {

enum class Arrival : std::uint8_t {
  first,      // nothing to compare with
  next,       // the expected number
  gap,        // newer than expected: the numbers between are counted lost
  duplicate,  // seen before
  late,       // was counted lost; taken back
  old,        // too far behind to tell late from duplicate, or from before the first
  restart,    // the sender began again
};

// Is the packet the newest so far? What an older one says is no longer so.
constexpr bool is_current(Arrival arrival) {
  return arrival == Arrival::first || arrival == Arrival::next || arrival == Arrival::gap ||
         arrival == Arrival::restart;
}

class R4LINK_API PacketTracker {
 public:
  Arrival on(std::uint32_t pnum);
  // The sender is known to have begun again: the next number is taken as its first.
  void restart();

  std::uint32_t newest() const { return newest_; }
  bool started() const { return started_; }
  const PacketCounters& counters() const { return counters_; }

  static constexpr std::uint32_t window = 64;
  // A jump ahead by more than this is a restarted sender, not a loss.
  static constexpr std::uint32_t max_gap = 65536;

 private:
  PacketCounters counters_;
  std::uint64_t seen_ = 0;  // bit i: newest_ - i was seen
  std::uint32_t newest_ = 0;
  std::uint32_t reach_ = 0;    // how far back seen_ goes: not before the sender's first number
  std::uint32_t suspect_ = 0;  // the number that would confirm a restart
  bool started_ = false;
  bool suspecting_ = false;
};

}  // namespace r4
