// SPDX-License-Identifier: GPL-3.0-or-later
// A session that only watches: it renews its lease, receives states, and sends no command.
#include <gtest/gtest.h>

#include "host/session/session.hpp"
#include "r4link/error.hpp"
#include "scripted_link.hpp"
#include "tests/support/datagrams.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;

struct SessionWatch : NewSession {
  SessionWatch() : NewSession(ScriptedLink::without_questions(), BoardRole::watch) {}
  // The board answers a W that does not echo a valid token.
  void tell(std::uint32_t token) {
    link.nack(link.last('W').pnum, "STALE;LEASE:" + std::to_string(token));
  }
};

TEST_F(SessionWatch, AsksForALeaseTwiceASecondAndSendsNothingElse) {
  link.pass(1900ms);
  EXPECT_EQ(link.count('W'), 4U);
  EXPECT_EQ(link.sent.size(), 4U) << "a watcher must not send heartbeats";
  EXPECT_EQ(link.last('W').command, "W:100");
  EXPECT_EQ(link.last('W').t, 0U) << "no token was heard to echo";
}

TEST_F(SessionWatch, EchoesALeaseAtOnce) {
  link.pass(10ms);
  tell(3912005417);
  link.pass(1ms);
  ASSERT_EQ(link.count('W'), 2U);
  EXPECT_EQ(link.last('W').t, 3912005417);
  link.state("AIN24:24.28;SAFE:1;");
  link.pass(700ms);
  link.heartbeat(SafeReason::link);
  link.pass(500ms);
  EXPECT_EQ(link.count('W'), 4U);
  EXPECT_EQ(link.last('W').t, 3912005417) << "the token stays until the board sends another token";
  tell(7);
  link.pass(1ms);
  EXPECT_EQ(link.last('W').t, 7U);
}

// A watcher gets states again after the program whose path it shared has ended.
TEST_F(SessionWatch, AsksAtOnceWhenATransportComesUp) {
  link.place_taken = true;
  link.pass(600ms);
  link.place_taken = false;
  link.sent.clear();
  link.session.on_transport(0, true, link.now);
  link.pass(0ms);
  EXPECT_EQ(link.count('W'), 1U);
}

TEST_F(SessionWatch, ABoardWithoutAHostConfirmsAStopOfAWatcher) {
  link.state("AIN24:24.28;SAFE:1;");
  const Ticket ticket = link.session.send(Command::stop(), 1s, link.now);
  link.raw(with_crc(
      "H:R4-ROS2;PNum:0;T:0;SAFE:2;CAUSE:1;STOP:" + std::to_string(link.last('E').pnum) + ";"));
  EXPECT_EQ(outcome(ticket), Outcome::confirmed);
}

TEST_F(SessionWatch, IsActiveButNeverInControl) {
  link.state("AIN24:24.28;SAFE:0;CMD:7;");
  EXPECT_EQ(link.session.link().state, HostLinkState::active);
  EXPECT_EQ(link.session.state().raw.analog_cv[0], 2428);
  EXPECT_FALSE(link.session.in_control(link.now));
  EXPECT_FALSE(link.session.link().causes.has(LinkCause::busy));
  EXPECT_FALSE(link.session.link().gated());
  link.pass(1100ms);
  EXPECT_EQ(link.session.link().state, HostLinkState::lost);
}

TEST_F(SessionWatch, ABootHeartbeatDoesNotChangeTheLinkOfAWatcher) {
  link.state("AIN24:24.28;SAFE:1;");
  const LinkStatus before = link.session.link();
  link.boot_heartbeat();
  EXPECT_EQ(link.session.link(), before);
  EXPECT_EQ(link.restarts, 0);
}

TEST_F(SessionWatch, AsksLessOftenIfTheBoardHasNoFreeLease) {
  link.nack(link.last('W').pnum, "BUSY");
  EXPECT_FALSE(link.session.link().causes.has(LinkCause::busy))
      << "no datagram showed another host in control";
  EXPECT_EQ(link.session.link().cause(), LinkCause::watchers_full);
  link.sent.clear();
  link.pass(3050ms);
  EXPECT_LE(link.count('W'), 4U);
  EXPECT_GE(link.count('W'), 3U);
}

TEST_F(SessionWatch, ReportsThatTheFirmwareServesNoWatchers) {
  link.nack(link.last('W').pnum, "UNKNOWN");
  EXPECT_EQ(link.session.link().cause(), LinkCause::not_watchable);
  link.nack(link.last('W').pnum, "STALE;LEASE:9");
  link.pass(1ms);
  EXPECT_EQ(link.last('W').t, 9U) << "the new firmware must be asked anew";
  link.state("SAFE:1;");
  EXPECT_TRUE(link.session.link().causes.empty());
}

TEST_F(SessionWatch, MayOnlyStopAndIdentifyTheBoard) {
  link.state("SAFE:0;");
  EXPECT_NE(link.session.send(Command::stop(), 1s, link.now), 0U);
  EXPECT_EQ(link.count('E'), 1U);
  EXPECT_NE(link.session.send(Command::identify(), 1s, link.now), 0U);
  EXPECT_EQ(link.count('Q'), 1U);
  const auto refused = [&](auto action) {
    const Problem problem = problem_of(action);
    EXPECT_EQ(problem.kind, ErrorKind::usage);
    EXPECT_TRUE(contains(problem.reason, "only watches")) << problem.reason;
  };
  refused([&] { link.session.send(Command::servo(1, Microseconds(1500)), 1s, link.now); });
  refused([&] { link.session.post(Command::clear(), link.now); });
  refused([&] { link.session.arm(1s, link.now); });
  const Setpoints wheels = Setpoints{Command::osmc(1, Pwm(358), Direction::forward),
                                     Command::osmc(2, Pwm(358), Direction::forward)};
  refused([&] { link.session.send(wheels, 1s, link.now); });
  refused([&] { link.session.post(wheels, link.now); });
  EXPECT_EQ(link.count('S'), 0U);
  EXPECT_EQ(link.count('O'), 0U);
}

TEST_F(SessionWatch, EndsItsLeaseWhenItEnds) {
  link.state("SAFE:0;");
  EXPECT_EQ(link.session.leave(100ms, link.now), 0U) << "a watcher's end needs no answer";
  EXPECT_EQ(link.last('W').command, "W:0");
  const std::size_t count = link.sent.size();
  link.pass(2s);
  EXPECT_EQ(link.sent.size(), count);
}

TEST(SessionWatchOptions, NameTheFieldsAndTheRate) {
  SessionOptions options = ScriptedLink::without_questions();
  options.fields = "ENC1,US1";
  options.watch_rate_hz = 5;
  ScriptedLink link(options, BoardRole::watch);
  EXPECT_EQ(link.last('W').command, "W:5,ENC1,US1");
  options.watch_rate_hz = 1001;
  EXPECT_EQ(problem_of([&] { ScriptedLink(options, BoardRole::watch); }).kind, ErrorKind::usage);
}

}  // namespace
}  // namespace r4::test
