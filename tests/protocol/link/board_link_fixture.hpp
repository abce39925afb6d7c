// SPDX-License-Identifier: GPL-3.0-or-later
// The board's end of the link in virtual time, with what hosts send to it.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "protocol/link/board_link.hpp"

namespace r4 {

constexpr Source here{0, 1};
constexpr Source there{0, 2};
constexpr std::uint32_t echo_pnum = echo_host_first_pnum + 100;

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
    sent.push_back(now);
  }

  static BoardLink::HostHeartbeat numbered(std::uint32_t pnum, std::uint64_t t, Source from) {
    BoardLink::HostHeartbeat heartbeat;
    heartbeat.from = from;
    heartbeat.has_pnum = true;
    heartbeat.pnum = pnum;
    heartbeat.has_time = true;
    heartbeat.t = t;
    return heartbeat;
  }
  HeartbeatEffect heartbeat(std::uint32_t pnum, std::uint64_t t, Source from = here) {
    const HeartbeatEffect effect = link.on_heartbeat(numbered(pnum, t, from), now);
    send_due();
    return effect;
  }
  // … read so late, perhaps.
  HeartbeatEffect late(std::uint32_t waited_ms, std::uint32_t pnum, std::uint64_t t,
                       Source from = here) {
    BoardLink::HostHeartbeat heartbeat = numbered(pnum, t, from);
    heartbeat.waited_ms = waited_ms;
    const HeartbeatEffect effect = link.on_heartbeat(heartbeat, now);
    send_due();
    return effect;
  }
  // As in the capture: no number.
  HeartbeatEffect numberless(std::uint64_t t, Source from = here) {
    BoardLink::HostHeartbeat heartbeat = numbered(0, t, from);
    heartbeat.has_pnum = false;
    const HeartbeatEffect effect = link.on_heartbeat(heartbeat, now);
    send_due();
    return effect;
  }

  // What becomes of a command: "execute", "drop" or the refusal's name.
  std::string command(std::uint32_t pnum, Source from = here) {
    Refusal code = Refusal::none;
    switch (link.admit(from, pnum, now, code)) {
      case Admission::execute:
        link.executed(pnum);
        return "execute";
      case Admission::drop:
        return "drop";
      case Admission::refuse:
        break;
    }
    return std::string(name_of(code).data(), name_of(code).size());
  }

  // An echo host in control; its heartbeats were echo_pnum and the next.
  void connect() {
    send_due();
    ASSERT_EQ(heartbeat(echo_pnum, 0), HeartbeatEffect::new_session);
    ASSERT_EQ(heartbeat(echo_pnum + 1, sent.back()), HeartbeatEffect::fed);
  }

  BoardLink link{BoardLink::Timing{}};
  std::uint32_t now = 700'000;
  std::uint32_t lost_at = 0;
  std::vector<std::uint32_t> sent;  // T of the board's heartbeats
};

}  // namespace r4
