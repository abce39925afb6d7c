// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include "protocol/link/board_link.hpp"

namespace r4 {
namespace {

BoardLink::HostHeartbeat numbered(std::uint32_t pnum, std::uint32_t t) {
  BoardLink::HostHeartbeat heartbeat;
  heartbeat.from = Source{0, 1};
  heartbeat.has_pnum = true;
  heartbeat.pnum = pnum;
  heartbeat.has_time = true;
  heartbeat.t = t;
  return heartbeat;
}

// A host that sends heartbeats and questions, and no command, for `count` datagrams. Returns its
// next number.
std::uint32_t idle(BoardLink& link, std::uint32_t& now_ms, std::uint32_t pnum,
                   std::uint32_t count) {
  std::uint32_t echo = 0;
  for (std::uint32_t i = 0; i < count; ++i, now_ms += 100) {
    if (link.heartbeat_due(now_ms)) {
      link.heartbeat_sent(now_ms);
      echo = now_ms;
    }
    link.on_heartbeat(numbered(pnum++, i == 0 ? 0 : echo), now_ms);
    link.poll(now_ms);
  }
  return pnum;
}

TEST(BoardLink, TakesCommandsOfAHostThatOnlySentHeartbeatsForHours) {
  BoardLink link(BoardLink::Timing{});
  std::uint32_t now_ms = 5000;
  const std::uint32_t pnum =
      idle(link, now_ms, echo_host_first_pnum, 3 * BoardLink::command_window);
  ASSERT_EQ(link.state(), BoardLinkState::active);
  Refusal code = Refusal::none;
  EXPECT_EQ(link.admit(Source{0, 1}, pnum, now_ms, code), Admission::execute)
      << "code " << static_cast<int>(code);
}

TEST(BoardLink, RefusesACommandFromBeforeHoursOfHeartbeats) {
  BoardLink link(BoardLink::Timing{});
  std::uint32_t now_ms = 5000;
  idle(link, now_ms, echo_host_first_pnum, 3 * BoardLink::command_window);
  Refusal code = Refusal::none;
  EXPECT_EQ(link.admit(Source{0, 1}, echo_host_first_pnum + 10, now_ms, code), Admission::refuse);
  EXPECT_EQ(code, Refusal::stale);
}

}  // namespace
}  // namespace r4
