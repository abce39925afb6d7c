// SPDX-License-Identifier: GPL-3.0-or-later
#include "bridge_audience.hpp"

namespace r4 {

BridgeAudience::Effect BridgeAudience::on_lease(Peer from, bool ends, std::uint64_t echo,
                                                Time now) {
  int others = 0;
  for_each_watcher(now, [&](Peer peer) { others += peer != from ? 1 : 0; });
  if (others >= most_watchers) return Effect::full;
  Place& place = place_of(from, now);
  const bool known = now < place.watches_until || now - place.told < lease;
  if (place.token == 0 || echo != place.token || !known) return Effect::unproven;
  place.watches_until = ends ? now : now + lease;
  return Effect::watching;
}

std::uint32_t BridgeAudience::new_token(Peer to, Time now) {
  Place& place = place_of(to, now);
  do place.token = random_();
  while (place.token == 0);
  place.told = now;
  return place.token;
}

void BridgeAudience::on_question(Peer from, std::optional<std::uint32_t> pnum, SessionId sid,
                                 Time now) {
  questions_[next_question_++ % questions_.size()] = {from, pnum, sid, now};
}

std::optional<Peer> BridgeAudience::asker_of(std::optional<std::uint32_t> pnum, SessionId sid,
                                             Time now) const {
  const Question* newest = nullptr;
  for (const Question& each : questions_) {
    if (each.at == Time() || now - each.at > curiosity) continue;
    if (each.pnum != pnum || each.sid != sid) continue;
    if (newest == nullptr || each.at >= newest->at) newest = &each;
  }
  if (newest == nullptr) return std::nullopt;
  return newest->from;
}

// A new peer takes a free place, or the place of the longest silent peer that does not watch.
BridgeAudience::Place& BridgeAudience::place_of(Peer peer, Time now) {
  Place* best = nullptr;
  for (Place& place : places_) {
    if (place.peer == peer && place.heard != Time()) {
      place.heard = now;
      return place;
    }
    if (now < place.watches_until) continue;
    if (best == nullptr || place.heard < best->heard) best = &place;
  }
  if (best == nullptr) best = places_.data();  // cannot occur: there are more places than watchers
  *best = Place();
  best->peer = peer;
  best->heard = now;
  return *best;
}

}  // namespace r4
