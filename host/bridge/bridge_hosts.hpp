// SPDX-License-Identifier: GPL-3.0-or-later
// The hosts of a bridge, by their session ids, and which of them the bridge serves.
//                 heartbeat             no BUSY of the board for `patience` after a
//                                       heartbeat that the board judges
//     unknown ---------------> asking ------------------------------------------> served
//                                | ^                                                |
//                           BUSY | | no BUSY for the timeout, or                    | BUSY
//                                v | the board reports that it has no host          |
//                              refused <--------------------------------------------+
//
// The board answers BUSY to every host but the controlling host. So the host that the board does
// not refuse is in control. Only served hosts get states, and their datagrams pass at once. Other
// hosts share a budget (bridged_pair.hpp).
//
// A served host keeps its place while its heartbeats arrive. If no other served host needed the
// place, the host is served again at once after a silence. A paper host has no session id, so the
// board cannot distinguish two paper hosts behind one bridge. Only one paper host passes at a time.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "r4link/datagram.hpp"
#include "r4link/vocabulary.hpp"

namespace r4 {

class BridgeHosts {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr std::size_t most = 16;  // besides the paper host
  // Longer than a board needs to answer.
  static constexpr std::chrono::milliseconds patience{50};
  // The board must have lost a silent paper host before another paper host passes.
  static constexpr std::chrono::milliseconds paper_margin{500};

  // `timeout`: of the board.
  explicit BridgeHosts(std::chrono::milliseconds timeout);

  // `judged`: the board begins or feeds a session by this heartbeat, or answers BUSY. False if the
  // heartbeat must not pass: there is another paper host, or `most` other hosts are served.
  bool on_heartbeat(Peer from, const Datagram& heartbeat, bool judged, Time now);
  void on_busy(SessionId sid, Time now);
  // The board reports that it has no host, so it refuses no host.
  void on_board_free() {
    for (Host& host : hosts_) host.refused_until = Time();
  }
  // True if served() has changed.
  bool poll(Time now);

  // The peers of the served hosts as of the last poll(), each peer once.
  const std::vector<Peer>& served() const { return served_; }
  // True if a heartbeat of this host passed at most a timeout ago.
  bool knows(Peer from, SessionId sid, Time now) const;
  // True if this host is served, or was before a silence: it then passes at once, on every path.
  bool trusts(Peer from, SessionId sid, Time now) const;
  bool serves(SessionId sid, Time now) const;
  // The number of this host's first heartbeat that passed since the last silence.
  std::optional<std::uint32_t> first_heartbeat(Peer from, SessionId sid) const;
  template <class Call>
  void for_each_path(SessionId sid, Time now, Call call) const {
    for (const Host& host : hosts_) {
      if (host.sid == sid && is_served(host, now)) call(host.peer);
    }
  }

 private:
  static constexpr Time never = Time::max();
  struct Host {
    Peer peer = everyone;
    SessionId sid = no_session;
    Time heard;  // Time(): the place is free
    std::optional<std::uint32_t> first_heartbeat;
    Time refused_until;
    Time served_from = never;
  };

  static bool is_of(const Host& host, Peer from, SessionId sid) {
    return host.heard != Time() && host.sid == sid && host.peer == from;
  }
  bool is_heard(const Host& host, Time now) const {
    return host.heard != Time() && now - host.heard < timeout_;
  }
  bool is_served(const Host& host, Time now) const {
    return is_heard(host, now) && now >= host.served_from;
  }
  Host* place_for(Peer from, SessionId sid, Time now);

  const std::chrono::milliseconds timeout_;
  std::array<Host, most + 1> hosts_;  // the first place is for a paper host
  std::vector<Peer> served_, next_;
};

}  // namespace r4
