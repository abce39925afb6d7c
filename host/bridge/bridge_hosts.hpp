// SPDX-License-Identifier: GPL-3.0-or-later
// The hosts behind a bridge, by their session ids, and which of them the board refuses.
//
//                 its heartbeat                  the board answers BUSY
//     unknown ---------------------> served <------------------------------> refused
//        ^                             |          `refusal` has passed          |
//        +------------------- silent for the timeout --------------------------+
//
// The board decides which host controls it. A bridge passes what they all send, and the board's states to those that
// the board does not refuse. Paper hosts have no session id, and the board cannot tell two of them apart behind one
// bridge: only one at a time is let through.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>

#include "r4link/vocabulary.hpp"

namespace r4 {

class BridgeHosts {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr std::size_t most = 16;
  // A host in vain sends heartbeats at 10 Hz at least, and each is refused.
  static constexpr std::chrono::milliseconds refusal{500};

  // `timeout`: the board's.
  explicit BridgeHosts(std::chrono::milliseconds timeout) : timeout_(timeout) {}

  enum class Heartbeat : std::uint8_t {
    known,     // it passes
    added,     // it passes, and its host is served from now on
    kept_out,  // another paper host is there, or `most` hosts
  };
  Heartbeat on_heartbeat(Peer from, SessionId sid, Time now);
  // True if commands of this host pass: its heartbeats do.
  bool knows(Peer from, SessionId sid, Time now) const;
  // The board has refused that session. True if it was served until now.
  bool on_busy(SessionId sid, Time now);

  // Calls `call(peer)` for each path of that session.
  template <class Call>
  void for_each_of(SessionId sid, Time now, Call call) const {
    for (const Host& host : hosts_) {
      if (is_heard(host, now) && host.sid == sid) call(host.peer);
    }
  }
  // Calls `call(peer)` for each host that is heard.
  template <class Call>
  void for_each(Time now, Call call) const {
    for (const Host& host : hosts_) {
      if (is_heard(host, now)) call(host.peer);
    }
  }
  // Calls `call(peer)` for each that is served.
  template <class Call>
  void for_each_served(Time now, Call call) const {
    for (const Host& host : hosts_) {
      if (is_served(host, now)) call(host.peer);
    }
  }
  bool serves_any(Time now) const;
  bool serves(Peer peer, Time now) const;

 private:
  struct Host {
    bool used = false;
    Peer peer = everyone;
    SessionId sid = no_session;
    Time heard;
    Time refused_until;
  };

  bool is_heard(const Host& host, Time now) const {
    return host.used && now - host.heard < timeout_;
  }
  bool is_served(const Host& host, Time now) const {
    return is_heard(host, now) && now >= host.refused_until;
  }

  const std::chrono::milliseconds timeout_;
  std::array<Host, most> hosts_;
};

}  // namespace r4
