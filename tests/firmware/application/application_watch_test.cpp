// SPDX-License-Identifier: GPL-3.0-or-later
// A watcher of a board: which states it gets, and that it changes nothing.
#include <gtest/gtest.h>

#include "tests/firmware/board_fixture.hpp"
#include "tests/support/signing.hpp"

namespace r4 {
namespace {

using firmware::BoardState;
using test::another_session;
using test::BoardInControl;
using test::Heard;
using test::our_session;
using test::state_of;
using test::TestBoard;
using test::TestHost;
using Lines = std::vector<std::string>;

struct TestWatcher {
  // The datagrams that the watcher received since the last call.
  std::vector<Heard> take() {
    std::vector<Heard> mine;
    for (const Heard& heard : board.take(at.port)) {
      if (heard.peer != at.peer) continue;
      mine.push_back(heard);
    }
    return mine;
  }
  std::vector<Heard> take(MessageKind kind) {
    std::vector<Heard> found;
    for (const Heard& heard : take()) {
      if (heard.kind == kind) found.push_back(heard);
    }
    return found;
  }
  void ask(const std::string& lease, std::uint64_t echo) {
    board.receive(
        "W:" + lease + ";PNum:" + std::to_string(pnum++) + ";T:" + std::to_string(echo) + ";", at);
  }
  // Requests a lease, receives the answer and echoes it.
  void watch(const std::string& lease) {
    take();
    ask(lease, 0);
    const std::vector<Heard> answers = take(MessageKind::nack);
    ASSERT_EQ(answers.size(), 1U);
    Datagram datagram;
    Nack nack;
    ASSERT_TRUE(read_datagram(answers[0].bytes, datagram) && read_nack(datagram, nack));
    EXPECT_EQ(nack.code, Refusal::stale);
    EXPECT_NE(nack.lease, 0U);
    token = nack.lease;
    ask(lease, token);
  }

  TestBoard& board;
  Source at;
  std::uint32_t pnum = 5;
  std::uint32_t token = 0;
};

TEST(ApplicationWatch, ABoardWithoutAHostStreamsToAWatcherAndStaysSafe) {
  TestBoard board;
  TestWatcher watcher{board, Source{0, 9}};
  board.run(100);
  watcher.watch("50");
  EXPECT_TRUE(board.log.refused.empty()) << "the board only asked for an echo";
  board.run(1000);
  const std::vector<Heard> heard = watcher.take();
  std::size_t states = 0;
  std::uint32_t next = heard.front().pnum;
  for (const Heard& each : heard) {
    EXPECT_EQ(each.pnum, next++) << "the watcher's own numbers, without a gap";
    if (each.kind != MessageKind::state) continue;
    ++states;
    EXPECT_EQ(state_of(each).safe, SafeReason::link);
  }
  EXPECT_NEAR(static_cast<double>(states), 50, 1);
  EXPECT_EQ(board.state(), BoardState::connecting) << "no host controls the board";
  EXPECT_EQ(board.hal.made_safe, 1);
  board.run(3000);
  watcher.take();
  board.run(1000);
  EXPECT_TRUE(watcher.take(MessageKind::state).empty()) << "its lease has ended";
}

TEST(ApplicationWatch, AHostCanEchoAHeartbeatSentToAWatcher) {
  TestBoard board;
  TestWatcher watcher{board, Source{0, 9}};
  board.run(100);
  watcher.watch("50");
  board.run(500);
  ASSERT_EQ(board.state(), BoardState::connecting);
  const std::vector<Heard> heartbeats = watcher.take(MessageKind::board_heartbeat);
  ASSERT_FALSE(heartbeats.empty());
  TestHost host(board, our_session);
  host.heartbeat(heartbeats.back().t_ms);
  EXPECT_EQ(board.state(), BoardState::active);
}

// On a bus, W shows only that a watcher exists (docs/reference/can.md).
TEST(ApplicationWatch, OnABusTheBoardStreamsToWatchersUntilAHostConnects) {
  TestBoard board({}, 2);
  board.ports[1].bus = true;
  board.run(100);
  board.receive("W:5;", Source{0, 0});
  board.run(1000);
  EXPECT_TRUE(board.take(MessageKind::state, 0).empty()) << "only on a bus W needs no proof";
  board.receive("W:5;", Source{1, 0});
  board.run(1000);
  const std::vector<Heard> states = board.take(MessageKind::state, 1);
  EXPECT_NEAR(static_cast<double>(states.size()), 5, 1);
  EXPECT_EQ(state_of(states.back()).safe, SafeReason::link);
  EXPECT_EQ(board.state(), BoardState::connecting) << "no host controls the board";

  TestHost host(board, our_session, Source{1, 0});
  host.connect();
  EXPECT_EQ(board.state(), BoardState::active);
  board.take(1);
  host.stay(200);
  board.receive("W:5;", Source{1, 0});
  host.stay(800);
  const std::vector<Heard> all = board.take(1);
  for (std::size_t i = 1; i < all.size(); ++i) EXPECT_EQ(all[i].pnum, all[i - 1].pnum + 1);
  EXPECT_NEAR(static_cast<double>(all.size()), 110, 10) << "the states for the host, once";
  board.run(3000);
  board.take(1);
  board.receive("W:5;", Source{1, 0});
  board.run(1000);
  EXPECT_NEAR(static_cast<double>(board.take(MessageKind::state, 1).size()), 5, 1);
  board.run(3000);
  board.take(1);
  board.run(1000);
  EXPECT_TRUE(board.take(MessageKind::state, 1).empty()) << "no watcher asks any more";
}

struct ApplicationWatched : BoardInControl {
  TestWatcher watcher{board, Source{0, 9}};
};

TEST_F(ApplicationWatched, AWatcherGetsItsRateAndTheHostLosesNothing) {
  watcher.watch("10");
  board.take();
  host.stay(1000);
  std::size_t to_watcher = 0;
  std::vector<std::uint32_t> to_host;
  for (const Heard& heard : board.take()) {
    if (heard.kind == MessageKind::state && heard.peer == 9) ++to_watcher;
    if (heard.peer == 4) to_host.push_back(heard.pnum);
  }
  EXPECT_NEAR(static_cast<double>(to_watcher), 10, 1);
  for (std::size_t i = 1; i < to_host.size(); ++i) EXPECT_EQ(to_host[i], to_host[i - 1] + 1);
  EXPECT_GE(to_host.size(), 100U);
}

TEST_F(ApplicationWatched, AWatcherChoosesItsFields) {
  watcher.watch("100,ENC1,US1");
  host.stay(100);
  const std::vector<Heard> states = watcher.take(MessageKind::state);
  ASSERT_FALSE(states.empty());
  EXPECT_EQ(states.back().bytes.rfind("ENC1:0;US1:0;PNum:", 0), 0U) << states.back().bytes;
}

TEST_F(ApplicationWatched, AWatcherCanCommandOnlyStops) {
  watcher.watch("10");
  host.command("O:358,1,1");
  board.take();
  board.receive("O:5,1,2;PNum:70;T:1;", watcher.at);
  board.receive("H:ROS2-R4;PNum:71;T:1;", watcher.at);
  // A farewell of the watcher, with the same echo as a farewell of the host.
  const std::string t = std::to_string(board.newest_t());
  board.receive("E:LEAVE;PNum:72;T:" + t + ";", watcher.at);
  EXPECT_EQ(board.outputs().osmc[1].pwm, 0);
  EXPECT_EQ(board.outputs().osmc[0].pwm, 358);
  EXPECT_EQ(board.state(), BoardState::active);
  board.receive("E:STOP;PNum:73;T:1;", watcher.at);
  EXPECT_EQ(board.outputs().osmc[0].pwm, 0);
  EXPECT_EQ(board.application->reason(), SafeReason::stop);
}

// An attacker may forge the address of the host and use the number of an executed command.
TEST_F(ApplicationWatched, AnswersToAWatcherDoNotNameTheSession) {
  const std::uint32_t pnum = host.command("O:358,1,1");
  host.echo();
  board.run(1050);  // the link is lost
  board.take();
  for (const char* const lease : {"10", "1001", "10,NOTHING", "x"})
    host.resend(std::string("W:") + lease, pnum);
  const std::vector<Heard> answers = board.take(MessageKind::nack);
  EXPECT_EQ(answers.size(), 4U);
  for (const Heard& answer : answers) {
    EXPECT_EQ(answer.bytes.find("SESSION"), std::string::npos) << answer.bytes;
  }
}

TEST(ApplicationWatch, ABoardWithoutRandomBytesRefusesWatchers) {
  test::MemoryHal hal;
  test::MemoryPort port;
  const std::uint32_t now_ms = 5;
  port.now_ms = &now_ms;
  firmware::Application board(hal, firmware::Application::Config());
  board.add_port(port);
  board.start(now_ms);
  port.sent.clear();
  board.receive(0, 9, test::with_crc("W:10;PNum:5;T:0;"), now_ms);
  ASSERT_EQ(port.sent.size(), 1U);
  EXPECT_EQ(port.sent[0].bytes.rfind("N:5,UNKNOWN;", 0), 0U) << port.sent[0].bytes;
}

TEST_F(ApplicationWatched, IgnoresAWatcherWithoutAPacketNumber) {
  board.take();
  board.receive("W:10;T:0;", watcher.at);
  EXPECT_TRUE(watcher.take().empty());
}

// On a bus, host and watcher share one address.
TEST_F(ApplicationWatched, AWatcherAtTheHostsAddressDoesNotAffectTheCounters) {
  TestWatcher beside{board, host.at, 1'000'000};
  for (int i = 0; i < 10; ++i) {
    beside.ask("10", 0);
    host.stay(100);
  }
  host.command("F:SAFE,RXLOST,RXDUP");
  board.take();
  host.stay(100);
  const State state = state_of(board.take(MessageKind::state).back());
  EXPECT_EQ(state.rx_lost, 0U);
  EXPECT_EQ(state.rx_duplicate, 0U);
}

// On a serial line every datagram reaches everyone, with the numbers of the line.
TEST(ApplicationWatch, AllDatagramsOnASerialLineShareItsNumbers) {
  TestBoard board({}, 2);
  TestWatcher watcher{board, Source{1, everyone}};
  TestHost host(board, our_session, Source{0, 4});
  host.connect();
  host.stay(500);
  watcher.watch("50");
  watcher.take();
  host.stay(500);
  std::size_t states = 0;
  const auto take = [&] {
    const std::vector<Heard> heard = watcher.take();
    states = 0;
    for (std::size_t i = 0; i < heard.size(); ++i) {
      if (heard[i].kind == MessageKind::state) ++states;
      const std::uint32_t before = i > 0 ? heard[i - 1].pnum : heard[i].pnum - 1;
      EXPECT_EQ(heard[i].pnum, before + 1) << heard[i].bytes;
    }
  };
  take();
  EXPECT_NEAR(static_cast<double>(states), 50, 1) << "the states for the host, and no others";
  board.run(1300);
  take();
  watcher.ask("50", watcher.token);
  board.run(1000);
  take();
  EXPECT_NEAR(static_cast<double>(states), 50, 1) << "no host is in control";
}

TEST_F(ApplicationWatched, AFifthWatcherIsAnsweredBusy) {
  for (std::uint32_t i = 0; i < 4; ++i) {
    TestWatcher each{board, Source{0, 20 + i}};
    host.stay(100);
    each.watch("10");
  }
  host.stay(100);
  forget();
  watcher.watch("10");
  EXPECT_EQ(answers(), (Lines{"BUSY"}));
}

TEST_F(ApplicationWatched, RefusesAnInvalidLease) {
  for (const auto& [lease, code] :
       std::vector<std::pair<std::string, std::string>>{{"1001", "RANGE"},
                                                        {"-1", "RANGE"},
                                                        {"x", "FORMAT"},
                                                        {"", "FORMAT"},
                                                        {"10,NOTHING", "UNKNOWN"}}) {
    forget();
    watcher.ask(lease, 0);
    EXPECT_EQ(answers(), Lines{code}) << lease;
  }
}

TEST_F(ApplicationWatched, TakingControlEndsTheLeaseOfAWatcher) {
  watcher.watch("10");
  host.echo();
  board.run(1000);  // the link is lost
  TestHost next(board, another_session, watcher.at);
  next.connect();
  board.take();
  next.stay(1000);
  EXPECT_NEAR(static_cast<double>(board.take(MessageKind::state).size()), 100, 1)
      << "each state once";
}

TEST_F(ApplicationWatched, StreamsToAWatcherAfterTheHostIsLost) {
  watcher.watch("100");
  host.echo();
  board.run(1050);
  watcher.take();
  board.run(200);
  const std::vector<Heard> states = watcher.take(MessageKind::state);
  EXPECT_GE(states.size(), 19U);
  EXPECT_EQ(state_of(states.back()).safe, SafeReason::link);
}

TEST(ApplicationWatch, WatchingNeedsNoKey) {
  TestBoard board(test::settings_with(test::key_of(1)));
  TestWatcher watcher{board, Source{0, 9}};
  watcher.watch("50");
  board.run(100);
  EXPECT_FALSE(watcher.take(MessageKind::state).empty());
}

}  // namespace
}  // namespace r4
