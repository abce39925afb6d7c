// SPDX-License-Identifier: GPL-3.0-or-later
// The peers that hear a board through a bridge besides the served hosts: watchers (docs/protocol.md,
// 4.8), and for a second each peer that stopped the board, that asks for control of it, or that
// needs its nonce to sign what it sends.
//
//     W:rate --> is told a LEASE --W:rate that echoes it--> hears everything for two seconds, again by the next W
//
// As at the board, nothing is streamed before the echo of a random number that was sent to that very
// peer. So nobody can have a bridge flood a third party by forging where a W comes from. For the
// same reason the answers to peers that have echoed nothing are few.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <random>

#include "r4link/vocabulary.hpp"

namespace r4 {

class BridgeAudience {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr std::chrono::milliseconds lease{2000};
  static constexpr std::chrono::milliseconds curiosity{1000};
  static constexpr std::size_t places = 16;
  static constexpr int most_watchers = 4;

  enum class Effect : std::uint8_t { watching, unproven, full };
  // `W` of a host, with its T; `rate` 0 ends its lease.
  Effect on_lease(Peer from, bool ends, std::uint64_t echo, Time now);
  // A new LEASE, which that host is told.
  std::uint32_t new_token(Peer to, Time now);

  // That peer is to hear the board's heartbeats for a while.
  void listen(Peer from, Time now) { place_of(from, now).listens_until = now + curiosity; }

  // It has sent the board a datagram of that number and session; none: of no number.
  void on_question(Peer from, std::optional<std::uint32_t> pnum, SessionId sid, Time now);
  // The peer that sent such a datagram last. An answer to a session goes to no peer that did not
  // name its id.
  std::optional<Peer> asker_of(std::optional<std::uint32_t> pnum, SessionId sid, Time now) const;

  // Calls `call(peer)` for each that hears states.
  template <class Call>
  void for_each_watcher(Time now, Call call) const {
    for (const Place& place : places_) {
      if (place.used && now < place.watches_until) call(place.peer);
    }
  }
  // Calls `call(peer)` for each that hears heartbeats and is no watcher. Each time it begins with
  // another one: where a budget does not suffice for all, each has its turn.
  template <class Call>
  void for_each_listener(Time now, Call call) {
    ++turn_;
    for (std::size_t i = 0; i < places; ++i) {
      const Place& place = places_[(turn_ + i) % places];
      if (place.used && now >= place.watches_until && now < place.listens_until) call(place.peer);
    }
  }
  bool has_watchers(Time now) const {
    bool any = false;
    if (any_) for_each_watcher(now, [&any](Peer) { any = true; });
    return any;
  }
  // True if nobody need be looked for.
  bool empty() const { return !any_; }

 private:
  struct Place {
    bool used = false;
    Peer peer = everyone;
    Time heard;
    std::uint32_t token = 0;  // 0: none
    Time told;
    Time watches_until;
    Time listens_until;
  };
  struct Question {
    Peer from = everyone;
    std::optional<std::uint32_t> pnum;
    SessionId sid = no_session;
    Time at;
  };

  Place& place_of(Peer peer, Time now);

  std::array<Place, places> places_;
  std::array<Question, 64> questions_;
  std::size_t next_question_ = 0;
  std::size_t turn_ = 0;
  bool any_ = false;
  std::random_device random_;
};

}  // namespace r4
