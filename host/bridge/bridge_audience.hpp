// SPDX-License-Identifier: GPL-3.0-or-later
// The peers, besides served hosts and watchers, to which a bridge sends a board's datagrams:
//     listeners    get heartbeats for a second: after a stop, to request control, for the nonce
//     askers       get the answer to a datagram that the bridge passed at most a second ago
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "r4link/vocabulary.hpp"

namespace r4 {

class BridgeAudience {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr std::chrono::milliseconds curiosity{1000};

  // A new listener replaces the listener whose time ends first.
  void listen(Peer from, Time now) {
    Listener* place = listeners_.data();
    for (Listener& each : listeners_) {
      if (place->peer == from) break;
      if (each.peer == from || each.until < place->until) place = &each;
    }
    *place = {from, now + curiosity};
  }
  // Each round begins with another listener, so that a small budget reaches all in turn.
  template <class Call>
  void for_each_listener(Time now, Call call) {
    ++turn_;
    for (std::size_t i = 0; i < listeners_.size(); ++i) {
      const Listener& each = listeners_[(turn_ + i) % listeners_.size()];
      if (now < each.until) call(each.peer);
    }
  }

  void on_question(Peer from, std::optional<std::uint32_t> pnum, SessionId sid, Time now) {
    questions_[next_question_++ % questions_.size()] = {from, pnum, sid, now};
  }
  // The newest asker. An answer to a session goes only to a peer that named the session's id.
  std::optional<Peer> asker_of(std::optional<std::uint32_t> pnum, SessionId sid, Time now) const {
    for (std::size_t i = 1; i <= questions_.size(); ++i) {
      const Question& each = questions_[(next_question_ - i) % questions_.size()];
      if (now - each.at > curiosity) break;
      if (each.pnum == pnum && each.sid == sid) return each.from;
    }
    return std::nullopt;
  }

 private:
  struct Listener {
    Peer peer = everyone;
    Time until;
  };
  struct Question {
    Peer from = everyone;
    std::optional<std::uint32_t> pnum;
    SessionId sid = no_session;
    Time at;
  };

  std::array<Listener, 16> listeners_;
  std::size_t turn_ = 0;
  std::array<Question, 64> questions_;  // a ring
  std::size_t next_question_ = 0;
};

}  // namespace r4
