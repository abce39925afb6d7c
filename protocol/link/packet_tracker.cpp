// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/messages/packet_tracker.hpp"

#include "../datagram/wrapping.hpp"

namespace r4 {

Arrival PacketTracker::on(std::uint32_t pnum) {
  ++counters_.received;
  if (!started_) {
    started_ = true;
    suspecting_ = false;
    newest_ = pnum;
    seen_ = 1;
    reach_ = 0;
    return Arrival::first;
  }
  const std::uint32_t ahead = pnum - newest_;
  const std::uint32_t behind = newest_ - pnum;
  if (newer(pnum, newest_) && ahead <= max_gap) {
    suspecting_ = false;
    seen_ = ahead < window ? (seen_ << ahead) | 1U : 1U;
    newest_ = pnum;
    reach_ = reach_ + ahead < window ? reach_ + ahead : window - 1;
    counters_.lost += ahead - 1;
    return ahead == 1 ? Arrival::next : Arrival::gap;
  }
  if (behind <= reach_) {
    suspecting_ = false;
    const std::uint64_t bit = std::uint64_t{1} << behind;
    if ((seen_ & bit) != 0) {
      ++counters_.duplicate;
      return Arrival::duplicate;
    }
    seen_ |= bit;
    ++counters_.late;
    --counters_.lost;
    return Arrival::late;
  }
  if (behind < window) {  // sent before the first datagram that arrived
    suspecting_ = false;
    ++counters_.old;
    return Arrival::old;
  }
  if (suspecting_ && pnum == suspect_) {
    ++counters_.restarts;
    suspecting_ = false;
    newest_ = pnum;
    seen_ = 3;  // this datagram, and the datagram that raised the suspicion
    reach_ = 1;
    return Arrival::restart;
  }
  suspecting_ = true;
  suspect_ = pnum + 1;
  ++counters_.old;
  return Arrival::old;
}

void PacketTracker::restart() {
  if (started_) ++counters_.restarts;
  started_ = false;
  suspecting_ = false;
}

}  // namespace r4
