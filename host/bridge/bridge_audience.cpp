// SPDX-License-Identifier: GPL-3.0-or-later
#include "bridge_audience.hpp"

namespace r4 {

BridgeAudience::Effect BridgeAudience::on_lease(Peer from, bool ends, std::uint64_t echo,
                                                Time now) {
  int watchers = 0;
  for (const Place& each : places_) {
    if (each.used && each.peer != from && now < each.watches_until) ++watchers;
  }
  if (watchers >= most_watchers) return Effect::full;
  Place& place = place_of(from, now);
  const bool known = now < place.watches_until || now - place.told < lease;
  if (place.token == 0 || echo != place.token || !known) return Effect::unproven;
  place.watches_until = ends ? now : now + lease;
  return Effect::watching;
}

std::uint32_t BridgeAudience::new_token(Peer to, Time now) {
  std::uint32_t token = 0;
  while (token == 0) token = random_();
  Place& place = place_of(to, now);
  place.token = token;
  place.told = now;
  return token;
}

void BridgeAudience::on_question(Peer from, std::optional<std::uint32_t> pnum, SessionId sid,
                                 Time now) {
  questions_[next_question_++ % questions_.size()] = {from, pnum, sid, now};
}

std::optional<Peer> BridgeAudience::asker_of(std::optional<std::uint32_t> pnum, SessionId sid,
                                             Time now) const {
  std::optional<Peer> asker;
  Time newest;
  for (const Question& each : questions_) {
    if (each.at == Time() || now - each.at > curiosity) continue;
    if (each.pnum != pnum || each.sid != sid) continue;
    if (asker && each.at < newest) continue;
    asker = each.from;
    newest = each.at;
  }
  return asker;
}

// The place of one that is new is that of who was silent longest, but of nobody who watches.
BridgeAudience::Place& BridgeAudience::place_of(Peer peer, Time now) {
  any_ = true;
  Place* best = nullptr;
  for (Place& place : places_) {
    if (place.used && place.peer == peer) {
      place.heard = now;
      return place;
    }
    if (place.used && now < place.watches_until) continue;
    const bool better =
        best == nullptr || (best->used && (!place.used || place.heard < best->heard));
    if (better) best = &place;
  }
  if (best == nullptr) best = places_.data();  // there are more places than may watch
  *best = Place();
  best->used = true;
  best->peer = peer;
  best->heard = now;
  return *best;
}

}  // namespace r4
