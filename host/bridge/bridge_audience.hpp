// SPDX-License-Identifier: GPL-3.0-or-later
// The peers, besides served hosts, to which a bridge sends a board's datagrams:
//     watchers     get states and heartbeats (docs/reference/protocol.md, 4.8)
//     listeners    get heartbeats for a second: after a stop, to request control, for the nonce
//
//     W:rate --> is sent a LEASE --W:rate that echoes the LEASE--> watches for two seconds
//                                                                  after each W
//
// A peer gets states only after it has echoed a random number. Otherwise a W with a forged sender
// address could make a bridge flood a third party. A peer without an echo gets few answers.
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
  // `echo`: the T of the peer's `W`. `ends`: the rate is 0, which ends the lease.
  Effect on_lease(Peer from, bool ends, std::uint64_t echo, Time now);
  std::uint32_t new_token(Peer to, Time now);

  void listen(Peer from, Time now) { place_of(from, now).listens_until = now + curiosity; }

  void on_question(Peer from, std::optional<std::uint32_t> pnum, SessionId sid, Time now);
  // An answer to a session goes only to a peer that named the session's id.
  std::optional<Peer> asker_of(std::optional<std::uint32_t> pnum, SessionId sid, Time now) const;

  template <class Call>
  void for_each_watcher(Time now, Call call) const {
    for (const Place& place : places_) {
      if (now < place.watches_until) call(place.peer);
    }
  }
  // Each round begins with another listener, so that a small budget reaches all in turn.
  template <class Call>
  void for_each_listener(Time now, Call call) {
    ++turn_;
    for (std::size_t i = 0; i < places; ++i) {
      const Place& place = places_[(turn_ + i) % places];
      if (now >= place.watches_until && now < place.listens_until) call(place.peer);
    }
  }
  bool has_watchers(Time now) const {
    bool any = false;
    for_each_watcher(now, [&any](Peer) { any = true; });
    return any;
  }

 private:
  struct Place {
    Peer peer = everyone;
    Time heard;  // Time(): the place is free
    std::uint32_t token = 0;
    Time told;  // when the token was sent
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
  std::random_device random_;
};

}  // namespace r4
