// SPDX-License-Identifier: GPL-3.0-or-later
// The peers, besides served hosts, that hear a board through a bridge: watchers
// (docs/reference/protocol.md, 4.8), and for a second each peer that stopped the board, asks for
// control, or needs the nonce.
//     W:rate --> is sent a LEASE --W:rate that echoes it--> hears everything for two seconds
//                                                           after each W
//
// A peer is streamed to only after it has echoed a random number: a W with a forged sender address
// cannot make a bridge flood a third party. Peers that have echoed nothing get few answers.
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
  // A `W` of a peer, with its T. `ends`: its rate is 0, which ends the lease.
  Effect on_lease(Peer from, bool ends, std::uint64_t echo, Time now);
  std::uint32_t new_token(Peer to, Time now);

  void listen(Peer from, Time now) { place_of(from, now).listens_until = now + curiosity; }

  void on_question(Peer from, std::optional<std::uint32_t> pnum, SessionId sid, Time now);
  // An answer to a session goes only to a peer that named its id.
  std::optional<Peer> asker_of(std::optional<std::uint32_t> pnum, SessionId sid, Time now) const;

  template <class Call>
  void for_each_watcher(Time now, Call call) const {
    for (const Place& place : places_) {
      if (now < place.watches_until) call(place.peer);
    }
  }
  // Calls `call(peer)` for each peer that hears heartbeats only. Each call begins with another
  // peer, so that a small budget reaches every peer in turn.
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
