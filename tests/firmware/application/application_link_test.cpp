// SPDX-License-Identifier: GPL-3.0-or-later
// Which host controls the board, and how the link begins, ends and recovers.
#include <gtest/gtest.h>

#include "tests/firmware/board_fixture.hpp"

namespace r4 {
namespace {

using firmware::BoardState;
using test::another_session;
using test::Heard;
using test::MemoryPort;
using test::our_session;
using test::TestBoard;
using test::TestHost;
using Lines = std::vector<std::string>;

TEST(ApplicationLink, SendsThePapersHeartbeatWhileConnecting) {
  TestBoard board;
  board.run(2000);
  const std::vector<Heard> heard = board.take();
  ASSERT_EQ(heard.size(), 5U);
  for (std::size_t i = 0; i < heard.size(); ++i) {
    EXPECT_EQ(heard[i].bytes, "H:R4-ROS2;PNum:0;T:0;^0xb10b3a06^");
    EXPECT_EQ(heard[i].at_ms, 500'000 + 500 * i);
    EXPECT_EQ(heard[i].peer, everyone);
  }
  EXPECT_EQ(board.state(), BoardState::connecting);
  EXPECT_EQ(board.hal.made_safe, 1);
}

TEST(ApplicationLink, AnswersAHostWithoutAnEchoOnlyOnItsPort) {
  TestBoard board({}, 2);
  TestHost host(board, our_session, Source{0, 3});
  board.run(777);
  board.take(0);
  board.take(1);
  host.heartbeat(0);
  const std::vector<Heard> heard = board.take();
  ASSERT_EQ(heard.size(), 1U);
  EXPECT_EQ(heard[0].kind, MessageKind::board_heartbeat);
  EXPECT_EQ(heard[0].peer, 3U);
  EXPECT_EQ(heard[0].pnum, 1U);
  EXPECT_EQ(heard[0].t_ms, board.now_ms);
  EXPECT_NE(heard[0].bytes.find(";SAFE:1;"), std::string::npos) << "also for watchers of a bus";
  EXPECT_EQ(board.state(), BoardState::connecting);
  EXPECT_TRUE(board.take(1).empty());
  host.heartbeat(board.now_ms);
  EXPECT_EQ(board.state(), BoardState::active);
}

TEST(ApplicationLink, StreamsAsSoonAsAHeartbeatStartsTheSession) {
  TestBoard board;
  TestHost host(board, no_session);
  board.run(777);
  board.take();
  host.heartbeat(0);
  const std::vector<Heard> heard = board.take();
  ASSERT_EQ(heard.size(), 2U);
  EXPECT_EQ(heard[0].kind, MessageKind::state);
  EXPECT_EQ(heard[0].pnum, 1U);
  EXPECT_EQ(heard[0].t_ms, board.now_ms);
  EXPECT_EQ(heard[1].kind, MessageKind::board_heartbeat);
  EXPECT_EQ(heard[1].pnum, 2U);
  EXPECT_EQ(heard[1].t_ms, board.now_ms);
  EXPECT_EQ(board.log.states, (Lines{"CONNECTING link", "ACTIVE none"}));
}

TEST(ApplicationLink, AcceptsAPaperHeartbeatWithoutNumberOrTime) {
  for (const char* fields : {"H:ROS2-R4;", "H:ROS2-R4;T:79201;", "H:ROS2-R4;PNum:1;",
                             "T:5;PNum:1;H:ROS2-R4;", "X:1;H:ROS2-R4;"}) {
    TestBoard board;
    board.receive(fields);
    // Two command fields are not a heartbeat.
    const bool expected = std::string(fields).rfind("X", 0) != 0;
    EXPECT_EQ(board.state() == BoardState::active, expected) << fields;
  }
}

TEST(ApplicationLink, GoesSafeExactlyAtTheTimeout) {
  TestBoard board;
  TestHost host(board, our_session);
  host.connect();
  host.stay(300);
  host.command("O:358,1,1");
  host.echo();
  board.run(999);
  EXPECT_EQ(board.outputs().osmc[0].pwm, 358);
  board.run(1);
  EXPECT_TRUE(board.safe());
  EXPECT_EQ(board.log.states.back(), "SAFE link");
  EXPECT_EQ(board.log.state_ms, board.now_ms);
}

TEST(ApplicationLink, TheTimeoutAppliesBeforeALateHeartbeat) {
  TestBoard board;
  TestHost host(board, no_session);
  host.heartbeat(5);
  host.command("O:358,1,1");
  board.now_ms += 999;  // the loop does not run
  board.application->poll(board.now_ms);
  board.now_ms += 1;
  board.application->drained(0);
  host.heartbeat(6);
  EXPECT_EQ(board.log.states,
            (Lines{"CONNECTING link", "ACTIVE none", "SAFE link", "ACTIVE none"}));
  EXPECT_EQ(board.hal.made_safe, 2);
}

// --- a loop that did not run

// A paper host controls a board whose loop runs.
struct ApplicationStandstill : testing::Test {
  ApplicationStandstill() {
    host.heartbeat(5);
    host.command("O:358,1,1");
    board.run(500);
    board.take();
  }
  // Milliseconds until the board becomes safe. 0: the board stays active for three seconds.
  std::uint32_t safe_after() {
    const std::uint32_t from_ms = board.now_ms;
    board.run(3000);
    return board.safe() ? board.log.state_ms - from_ms : 0;
  }

  TestBoard board;
  TestHost host{board, no_session};
};

TEST_F(ApplicationStandstill, AWaitingHeartbeatCountsFromTheStartOfTheStandstill) {
  board.now_ms += 300;  // the heartbeat arrived when the standstill began
  host.heartbeat(6);
  EXPECT_FALSE(board.safe());
  EXPECT_EQ(safe_after(), 1000U - 300U);
}

TEST_F(ApplicationStandstill, AWaitingHeartbeatReadAfterAPollCountsFromTheStart) {
  board.now_ms += 300;
  board.application->poll(board.now_ms);  // the timer fired before the waiting datagrams were read
  board.run(20);
  host.heartbeat(6);
  EXPECT_EQ(safe_after(), 1000U - 320U);
}

TEST_F(ApplicationStandstill, AHeartbeatAfterTheBacklogCountsFromItsArrival) {
  board.now_ms += 300;
  host.heartbeat(6);
  board.application->drained(0);
  board.run(5);
  host.heartbeat(7);
  EXPECT_EQ(safe_after(), 1000U);
}

TEST_F(ApplicationStandstill, TheBacklogOfAPortEndsAfterTheCatchUpTime) {
  board.now_ms += 300;
  board.run(firmware::Application::catch_up_ms);
  host.heartbeat(6);
  EXPECT_EQ(safe_after(), 1000U);
}

TEST_F(ApplicationStandstill, ASecondStandstillAddsToTheFirst) {
  board.now_ms += 100;
  board.application->poll(board.now_ms);
  board.now_ms += 150;
  host.heartbeat(6);
  EXPECT_EQ(safe_after(), 1000U - 250U);
}

TEST_F(ApplicationStandstill, AShortPauseIsNotAStandstill) {
  board.now_ms += firmware::Application::standstill_ms;
  host.heartbeat(6);
  EXPECT_EQ(safe_after(), 1000U);
}

TEST_F(ApplicationStandstill, EachPortHasItsOwnBacklog) {
  TestBoard two({}, 2);
  TestHost driver(two, no_session, Source{1, 4});
  driver.heartbeat(5);
  driver.command("O:358,1,1");
  two.now_ms += 300;
  two.application->poll(two.now_ms);
  two.application->drained(0);
  driver.heartbeat(6);
  const std::uint32_t read_ms = two.now_ms;
  two.run(3000);
  EXPECT_EQ(two.log.state_ms - read_ms, 1000U - 300U);
  two.application->drained(2);  // there is no port 2
}

TEST_F(ApplicationStandstill, AHeartbeatThatMayBeTooOldGivesNoControl) {
  board.now_ms += 5000;
  host.heartbeat(6);
  EXPECT_EQ(board.log.states.back(), "SAFE link");
  EXPECT_TRUE(board.safe());
  EXPECT_EQ(board.take(MessageKind::board_heartbeat).size(), 2U)
      << "the board asks for another heartbeat";
  board.application->drained(0);
  board.run(1);
  host.heartbeat(7);
  EXPECT_EQ(board.log.states.back(), "ACTIVE none");
  EXPECT_TRUE(board.safe()) << "a paper host starts a new session";
}

TEST_F(ApplicationStandstill, TheGuardsDeadlineCountsFromTheStandstill) {
  board.now_ms += 300;
  host.heartbeat(6);
  EXPECT_FALSE(board.application->guard().tripped());
  board.application->guard().tick(board.now_ms + 699);
  EXPECT_FALSE(board.application->guard().tripped());
  board.application->guard().tick(board.now_ms + 700);
  EXPECT_EQ(board.application->guard().take(), SafeReason::link);
}

TEST_F(ApplicationStandstill, AStopActsAtOnceButAClearWithoutACauseMustWait) {
  board.now_ms += 300;
  board.receive("E:STOP;", Source{0, 9});
  EXPECT_EQ(board.log.states.back(), "SAFE stop");
  board.application->drained(0);
  host.heartbeat(6);
  board.run(500);
  host.heartbeat(7);
  board.run(300);
  board.now_ms += 300;  // the E:CLEAR may have been sent too soon after the stop
  host.heartbeat(8);
  host.command("E:CLEAR");
  EXPECT_EQ(board.log.states.back(), "SAFE stop");
  board.application->drained(0);
  host.command("E:CLEAR");
  EXPECT_EQ(board.log.states.back(), "ACTIVE none");
}

TEST_F(ApplicationStandstill, ACommandAfterAWaitingHeartbeatIsExecuted) {
  board.now_ms += 300;
  host.heartbeat(6);
  host.command("O:100,1,1");
  EXPECT_EQ(board.outputs().osmc[0].pwm, 100);
}

TEST_F(ApplicationStandstill, ACommandOvertakenByAWaitingHeartbeatIsStale) {
  const std::uint32_t overtaken = host.pnum++;
  board.now_ms += 300;
  host.heartbeat(6);
  host.resend("O:100,1,1", overtaken);  // the command may be 300 ms younger than the heartbeat
  EXPECT_EQ(board.log.refused, (Lines{std::to_string(overtaken) + " STALE"}));
}

TEST(ApplicationLink, RefusesACommandAfterTheTimeout) {
  TestBoard board;
  TestHost host(board, no_session);
  host.heartbeat(5);
  board.now_ms += 1000;
  host.command("O:358,1,1");
  EXPECT_TRUE(board.safe());
  EXPECT_EQ(board.log.refused, (Lines{"12346 SAFE"}));
}

TEST(ApplicationLink, SendsOnlyHeartbeatsWhileTheLinkIsLost) {
  TestBoard board;
  TestHost host(board, our_session);
  host.connect();
  board.run(1000);
  board.take();
  const std::uint32_t lost = board.now_ms;
  board.run(2000);
  const std::vector<Heard> heard = board.take();
  ASSERT_EQ(heard.size(), 4U);
  for (std::size_t i = 0; i < heard.size(); ++i) {
    EXPECT_EQ(heard[i].kind, MessageKind::board_heartbeat);
    EXPECT_EQ(heard[i].t_ms, lost + 500 * (i + 1));
    EXPECT_NE(heard[i].bytes.find(";SAFE:1;"), std::string::npos);
  }
}

TEST(ApplicationLink, SendsAPaperHostTwoHeartbeatsASecond) {
  TestBoard board;
  TestHost host(board, no_session);
  host.heartbeat(1);
  board.take();
  for (int i = 0; i < 20; ++i) {
    host.heartbeat(static_cast<std::uint64_t>(i) + 2);
    board.run(100);
  }
  EXPECT_EQ(board.take(MessageKind::board_heartbeat).size(), 4U);
}

TEST(ApplicationLink, RefusesAPortTooManyAndIgnoresItsDatagrams) {
  TestBoard board(Settings(), firmware::Application::max_ports);
  MemoryPort more;
  more.now_ms = &board.now_ms;
  const std::uint8_t number = board.application->add_port(more);
  EXPECT_EQ(number, firmware::Application::no_port);
  board.receive("H:ROS2-R4;PNum:1;T:0;", {number, 0});
  board.receive("E:STOP;", {number, 0});
  board.application->port_down(number, board.now_ms);
  board.run(600);
  EXPECT_EQ(board.state(), BoardState::connecting);
  EXPECT_EQ(board.reason(), SafeReason::link);
  EXPECT_TRUE(more.sent.empty());
  EXPECT_FALSE(board.take(firmware::Application::max_ports - 1).empty())
      << "the last port is served";
}

TEST(ApplicationLink, InformsThePortWhichPeerHasControl) {
  TestBoard board({}, 2);
  TestHost host(board, no_session, {1, 7});
  TestHost other(board, no_session, {1, 8});
  host.echo();
  host.echo();
  EXPECT_EQ(board.ports[1].held, 7U);
  other.echo();
  EXPECT_EQ(board.ports[1].held, 7U);
  board.run(1001);
  ASSERT_EQ(board.reason(), SafeReason::link);
  EXPECT_EQ(board.ports[1].held, everyone);
  host.echo();
  EXPECT_EQ(board.ports[1].held, 7U) << "the session is back";
  board.application->port_down(1, board.now_ms);
  EXPECT_EQ(board.ports[1].held, everyone);
  other.echo();
  EXPECT_EQ(board.ports[1].held, 8U);
  EXPECT_EQ(board.ports[0].held, everyone);
}

// --- recovery

TEST(ApplicationLink, RestoresTheOutputsForTheSameHost) {
  TestBoard board;
  TestHost host(board, our_session);
  host.connect();
  host.command("O:358,1,1");
  host.command("F:AIN24");
  board.run(1500);
  EXPECT_TRUE(board.safe());
  host.echo();
  EXPECT_EQ(board.outputs().osmc[0].pwm, 358);
  EXPECT_EQ(board.log.states.back(), "ACTIVE none");
  board.take();
  board.run(10);
  const State state = state_of(board.take(MessageKind::state).back());
  EXPECT_FALSE(state.present.has(StateField::ain12));  // the selection belongs to the session
}

TEST(ApplicationLink, RearmKeepsTheOutputsOffUntilAFreshCommand) {
  Settings settings;
  settings.recovery = Recovery::rearm;
  TestBoard board(settings);
  TestHost host(board, our_session);
  host.connect();
  host.command("O:358,1,1");
  host.command("S:1500,2");
  board.run(1500);
  host.echo();
  EXPECT_EQ(board.log.states.back(), "ACTIVE none");
  EXPECT_TRUE(board.safe());
  host.command("S:1600,2");
  EXPECT_EQ(board.outputs().servo_us[1], 1600);
  EXPECT_EQ(board.outputs().osmc[0].pwm, 0);
}

TEST(ApplicationLink, RestoresNothingForAnotherHost) {
  TestBoard board;
  TestHost first(board, our_session, Source{0, 1});
  first.connect();
  first.command("O:358,1,1");
  board.run(1500);
  TestHost second(board, another_session, Source{0, 2});
  second.connect();
  EXPECT_EQ(board.log.states.back(), "ACTIVE none");
  EXPECT_TRUE(board.safe());
  first.command("O:1,1,1");
  EXPECT_EQ(board.log.refused.back(), std::to_string(first.pnum - 1) + " BUSY");
}

TEST(ApplicationLink, AHostRestartMakesTheOutputsSafeWithinTheTimeout) {
  TestBoard board;
  TestHost host(board, our_session);
  host.connect();
  host.stay(200);
  host.command("O:358,1,1");
  host.command("F:AIN24");
  TestHost restarted(board, another_session);
  restarted.heartbeat(0);
  EXPECT_EQ(board.outputs().osmc[0].pwm, 358);  // the restart is not proven yet
  board.run(1010);
  restarted.echo();
  EXPECT_TRUE(board.safe());
  EXPECT_EQ(board.state(), BoardState::active);
  board.take();
  board.run(10);
  const State state = state_of(board.take(MessageKind::state).back());
  EXPECT_TRUE(state.present.has(StateField::ain12));  // the default selection again
}

TEST(ApplicationLink, AnswersAHostThatHasNothingToEcho) {
  TestBoard board;
  TestHost host(board, our_session, Source{0, 1});
  host.connect();
  board.run(1500);
  board.take();
  TestHost other(board, another_session, Source{0, 9});
  other.heartbeat(0);
  const std::vector<Heard> heard = board.take(MessageKind::board_heartbeat);
  ASSERT_EQ(heard.size(), 1U);
  EXPECT_EQ(heard[0].peer, 9U);
  EXPECT_EQ(heard[0].t_ms, board.now_ms);
}

TEST(ApplicationLink, AnswersAHostThatEchoesAnOldTime) {
  TestBoard board;
  TestHost host(board, our_session, Source{0, 3});
  board.take();
  host.heartbeat(123456);
  EXPECT_EQ(board.state(), BoardState::connecting);
  std::vector<Heard> heard = board.take();
  ASSERT_EQ(heard.size(), 1U);
  EXPECT_EQ(heard[0].t_ms, board.now_ms);
  EXPECT_EQ(heard[0].peer, 3U);

  board.run(20);
  host.connect();
  const std::uint32_t old_t = board.newest_t();
  board.run(1500);
  board.take();
  host.heartbeat(old_t);
  EXPECT_EQ(board.state(), BoardState::safe);
  EXPECT_EQ(board.take(MessageKind::board_heartbeat).size(), 1U);
}

// --- several hosts and ports

TEST(ApplicationLink, TheSamePeerNumberOnAnotherPortIsAnotherHost) {
  TestBoard board(Settings(), 2);
  TestHost owner(board, our_session, Source{0, 1});
  TestHost other(board, another_session, Source{1, 1});
  owner.connect();
  other.command("O:358,1,1");
  EXPECT_TRUE(board.safe());
  EXPECT_EQ(board.take(MessageKind::nack, 1).size(), 1U);
  EXPECT_EQ(board.take(MessageKind::nack, 0).size(), 0U);
}

TEST(ApplicationLink, AnswersToOtherHostsHaveTheirOwnNumbers) {
  TestBoard board;
  TestHost owner(board, our_session, Source{0, 1});
  TestHost other(board, another_session, Source{0, 2});
  owner.connect();
  for (int i = 0; i < 50; ++i) {
    other.command("Q:ID");
    other.heartbeat(0);
    other.clear();
    owner.command("Q:ID");
    owner.echo();
    board.run(10);
  }
  std::uint32_t next = 0;
  for (const Heard& heard : board.take()) {
    if (heard.peer != 1 || heard.t_ms == 0) continue;
    if (next != 0) {
      EXPECT_EQ(heard.pnum, next);
    }
    next = heard.pnum + 1;
  }
  EXPECT_GT(next, 100U);
}

TEST(ApplicationLink, StreamsOnEveryPortWithItsOwnNumbers) {
  TestBoard board(Settings(), 3);
  TestHost owner(board, our_session, Source{1, 6});
  owner.connect();
  owner.stay(200);
  for (int port = 0; port < 3; ++port) {
    std::uint32_t next = 0;
    std::size_t states = 0;
    for (const Heard& heard : board.take(port)) {
      if (heard.t_ms == 0) continue;  // a state from before the session
      if (next != 0) {
        EXPECT_EQ(heard.pnum, next);
      }
      next = heard.pnum + 1;
      states += heard.kind == MessageKind::state;
      EXPECT_EQ(heard.peer, port == 1 ? 6U : everyone);
    }
    EXPECT_EQ(states, 21U) << "port " << port;
  }
}

TEST(ApplicationLink, TheFirstNumberOfASessionIsOneOnEveryPort) {
  TestBoard board(Settings(), 2);
  TestHost owner(board, no_session);
  owner.heartbeat(0);
  EXPECT_EQ(board.take(MessageKind::state, 0)[0].pnum, 1U);
  EXPECT_EQ(board.take(MessageKind::state, 1)[0].pnum, 1U);
}

// The paper's Python client puts T before PNum, has a clock in seconds, and answers each heartbeat.
TEST(ApplicationLink, ServesThePapersPythonClient) {
  TestBoard board;
  std::uint32_t pnum = 0;
  for (int ms = 0; ms < 10'000; ++ms) {
    for (const Heard& heard : board.take()) {
      const std::string t = std::to_string(4000 + ms / 1000);
      auto send = [&](const std::string& field) {
        board.receive(field + ";T:" + t + ";PNum:" + std::to_string(pnum++) + ";");
      };
      if (heard.kind == MessageKind::board_heartbeat) send("H:ROS2-R4");
      for (const char* field : {"D:1000,1,1", "D:1000,0,2", "D:1000,1,3", "D:1000,0,4", "S:300,1",
                                "S:100,2", "S:1000,3"}) {
        send(field);
      }
    }
    board.run(1);
  }
  EXPECT_EQ(board.log.states, (Lines{"CONNECTING link", "ACTIVE none"}));
  EXPECT_EQ(board.outputs().dhb12[2].pwm, 1000);
  EXPECT_EQ(board.outputs().servo_us[2], 1000);
  EXPECT_GT(board.log.executed.size(), 6900U);
}

TEST(ApplicationLink, ASessionContinuesWhenTheClockWraps) {
  // Heartbeats are due every half second, so a heartbeat is due exactly when the clock wraps.
  TestBoard board({}, 1, 0U - 2000U);
  TestHost host{board, our_session, Source{0, 4}};
  host.connect();
  host.command("O:358,1,1");
  board.take();
  board.log.states.clear();
  host.stay(5000);
  EXPECT_EQ(board.log.states, std::vector<std::string>{});
  EXPECT_EQ(board.outputs().osmc[0].pwm, 358);
  for (const Heard& heard : board.take(MessageKind::board_heartbeat)) EXPECT_NE(heard.t_ms, 0U);
}

}  // namespace
}  // namespace r4
