// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include "protocol/link/board_link.hpp"

namespace r4 {
namespace {

constexpr HostId host{Source{0, 1}, 77};
constexpr std::uint32_t first_number = 1000;

BoardLink::HostHeartbeat numbered(std::uint32_t pnum, std::uint32_t t) {
  BoardLink::HostHeartbeat heartbeat;
  heartbeat.host = host;
  heartbeat.has_pnum = true;
  heartbeat.pnum = pnum;
  heartbeat.t = t;
  return heartbeat;
}

// A host that sends `count` heartbeats and questions, and no command. Returns its next packet
// number.
std::uint32_t idle(BoardLink& link, std::uint32_t& now_ms, std::uint32_t pnum,
                   std::uint32_t count) {
  std::uint32_t echo = 0;
  for (std::uint32_t i = 0; i < count; ++i, now_ms += 100) {
    if (link.heartbeat_due(now_ms)) {
      link.heartbeat_sent(now_ms);
      link.shown(now_ms);
      echo = now_ms;
    }
    const std::uint32_t t = i == 0 ? 0 : i == 1 ? now_ms : echo;
    if (i == 1) link.shown(link.answer_time(now_ms));  // the answer to the first heartbeat
    link.on_heartbeat(numbered(pnum++, t), now_ms);
    link.poll(now_ms);
  }
  return pnum;
}

TEST(BoardLink, AcceptsACommandAfterHoursOfHeartbeats) {
  BoardLink link(BoardLink::Timing{});
  std::uint32_t now_ms = 5000;
  const std::uint32_t pnum = idle(link, now_ms, first_number, 3 * BoardLink::command_window);
  ASSERT_EQ(link.state(), BoardLinkState::active);
  EXPECT_EQ(link.admit(host, pnum, now_ms), Refusal::none);
}

TEST(BoardLink, RefusesACommandFromBeforeHoursOfHeartbeats) {
  BoardLink link(BoardLink::Timing{});
  std::uint32_t now_ms = 5000;
  idle(link, now_ms, first_number, 3 * BoardLink::command_window);
  EXPECT_EQ(link.admit(host, first_number + 10, now_ms), Refusal::stale);
}

}  // namespace
}  // namespace r4
