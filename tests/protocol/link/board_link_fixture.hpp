// SPDX-License-Identifier: GPL-3.0-or-later
// The board's end of the link in virtual time, and the heartbeats and commands of its hosts.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "protocol/link/board_link.hpp"

namespace r4 {

constexpr Source here{0, 1};
constexpr Source there{0, 2};
constexpr HostId ours{here, 0x1111};   // the host of connect()
constexpr HostId other{here, 0x2222};  // another host, at the same address
constexpr HostId paper{here, no_session};
constexpr std::uint32_t first_number = 0x80000064U;

struct BoardLinkTest : testing::Test {
  // Sends the heartbeats that are due, as the application does.
  void run(std::uint32_t ms) {
    for (std::uint32_t i = 0; i < ms; ++i) {
      ++now;
      if (link.poll(now)) lost_at = now;
      send_due();
    }
  }
  void send_due() {
    if (!link.heartbeat_due(now)) return;
    link.heartbeat_sent(now);
    link.shown(now);
    sent.push_back(now);
  }
  // The board answers one peer. Returns the T of the answer.
  std::uint32_t answer() {
    const std::uint32_t t = link.answer_time(now);
    link.shown(t);
    return t;
  }

  static BoardLink::HostHeartbeat numbered(std::uint32_t pnum, std::uint64_t t, HostId host) {
    BoardLink::HostHeartbeat heartbeat;
    heartbeat.host = host;
    heartbeat.has_pnum = true;
    heartbeat.pnum = pnum;
    heartbeat.t = t;
    return heartbeat;
  }
  HeartbeatEffect take(const BoardLink::HostHeartbeat& heartbeat) {
    const HeartbeatEffect effect = link.on_heartbeat(heartbeat, now);
    send_due();
    return effect;
  }
  HeartbeatEffect heartbeat(std::uint32_t pnum, std::uint64_t t, HostId host = ours) {
    return take(numbered(pnum, t, host));
  }
  // A heartbeat that may have waited for up to `waited_ms` before the board read it.
  HeartbeatEffect late(std::uint32_t waited_ms, std::uint32_t pnum, std::uint64_t t,
                       HostId host = ours) {
    BoardLink::HostHeartbeat heartbeat = numbered(pnum, t, host);
    heartbeat.waited_ms = waited_ms;
    return take(heartbeat);
  }
  // A heartbeat without a packet number, as in the paper's capture.
  HeartbeatEffect numberless(std::uint64_t t, HostId host = paper) {
    BoardLink::HostHeartbeat heartbeat = numbered(0, t, host);
    heartbeat.has_pnum = false;
    return take(heartbeat);
  }

  // Returns "execute", or the name of the refusal.
  std::string command(std::uint32_t pnum, HostId host = ours) {
    const Refusal code = link.admit(host, pnum, now);
    if (code == Refusal::none) {
      link.executed(pnum);
      return "execute";
    }
    return std::string(name_of(code).data(), name_of(code).size());
  }

  // Connects a host with a SID. The first heartbeat has no echo and the number first_number. The
  // second heartbeat has the next number.
  void connect() {
    send_due();
    ASSERT_EQ(heartbeat(first_number, 0), HeartbeatEffect::unheard);
    ASSERT_EQ(heartbeat(first_number + 1, answer()), HeartbeatEffect::new_session);
  }
  void begin_anew() {
    link = BoardLink(BoardLink::Timing{});
    sent.clear();
    connect();
  }

  BoardLink link{BoardLink::Timing{}};
  std::uint32_t now = 700'000;
  std::uint32_t lost_at = 0;
  std::vector<std::uint32_t> sent;  // T of the board's heartbeats
};

}  // namespace r4
