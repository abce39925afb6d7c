// SPDX-License-Identifier: GPL-3.0-or-later
// Every cause of the safe state: how the board enters it, which setpoints remain, and how the board
// leaves it.
#include <gtest/gtest.h>

#include "tests/firmware/board_fixture.hpp"

namespace r4 {
namespace {

using firmware::BoardState;
using test::another_session;
using test::Heard;
using test::our_session;
using test::TestBoard;
using test::TestHost;
using Lines = std::vector<std::string>;

struct ApplicationSafety : testing::Test {
  ApplicationSafety() {
    host.connect();
    host.stay(300);
    host.command("O:358,1,1");
    EXPECT_EQ(board.outputs().osmc[0].pwm, 358);
    board.take();
    board.log.states.clear();
  }
  void distance(int cm) {
    board.hal.inputs.ultrasonic_cm[0] = static_cast<std::uint16_t>(cm);
    board.run(10);
  }
  void handle(bool held) {
    board.hal.inputs.handle = held ? Handle::held : Handle::released;
    board.run(10);
  }
  // Sends E:CLEAR as the controlling host, which has received the newest cause.
  std::uint32_t clear() {
    board.run(0);
    return host.clear();
  }
  // Only a command restores outputs, whatever else the host sends.
  void expect_nothing_restored() {
    host.stay(200);
    EXPECT_EQ(board.state(), BoardState::active);
    EXPECT_TRUE(board.safe());
    host.command("S:1500,1");
    EXPECT_EQ(board.outputs().servo_us[0], 1500);
    EXPECT_EQ(board.outputs().osmc[0].pwm, 0);
  }

  TestBoard board;
  TestHost host{board, our_session, Source{0, 4}};
};

// --- stop

TEST_F(ApplicationSafety, AStopIsLatchedUntilItIsCleared) {
  host.command("E:STOP");
  EXPECT_TRUE(board.safe());
  EXPECT_EQ(board.log.states, Lines{"SAFE stop"});
  host.stay(1000);
  host.command("O:1,1,1");
  EXPECT_TRUE(board.safe());
  EXPECT_EQ(board.log.refused.size(), 1U);
  clear();
  EXPECT_EQ(board.log.states, (Lines{"SAFE stop", "ACTIVE none"}));
  expect_nothing_restored();
}

TEST_F(ApplicationSafety, AStopIsObeyedFromAnyPeer) {
  board.receive("E:STOP;PNum:1;T:1;", Source{0, 99});
  EXPECT_TRUE(board.safe());
  clear();
  host.command("O:1,1,1");
  EXPECT_FALSE(board.safe());
  board.receive("E:STOP;", Source{0, 99});  // without a number
  EXPECT_TRUE(board.safe());
}

TEST_F(ApplicationSafety, AStopIsObeyedAmongOtherCommands) {
  host.command("O:1,1,1");
  EXPECT_FALSE(board.safe());
  board.receive("O:2,1,1;E:STOP;PNum:1;T:1;", Source{0, 99});
  EXPECT_TRUE(board.safe());
  EXPECT_TRUE(board.log.refused.empty());
}

TEST_F(ApplicationSafety, AnOldStopIsObeyed) {
  const std::uint32_t old = host.pnum++;
  for (int i = 0; i < 100; ++i) host.command("S:1,1");
  host.stay(500);
  host.resend("E:STOP", old);
  EXPECT_TRUE(board.safe());
  clear();
  host.command("O:1,1,1");
  host.resend("E:STOP", old);
  EXPECT_TRUE(board.safe());
}

TEST_F(ApplicationSafety, AStopMakesEarlierCommandsStale) {
  const std::uint32_t before = host.pnum++;
  host.command("E:STOP");
  clear();
  host.resend("O:1,1,1", before);
  EXPECT_TRUE(board.safe());
  EXPECT_EQ(board.log.refused, Lines{std::to_string(before) + " STALE"});
}

TEST_F(ApplicationSafety, AStopWithoutASessionUsesUpNoCommandNumber) {
  const std::uint32_t executed = host.command("O:1,1,1");
  board.receive("E:STOP;PNum:" + std::to_string(host.pnum + 1000) + ";T:0;", host.at);
  EXPECT_EQ(board.reason(), SafeReason::stop);
  EXPECT_EQ(board.application->link().last_executed(), executed);
  board.log.refused.clear();
  host.resend("O:1,1,1", executed);
  EXPECT_EQ(board.log.refused, Lines{std::to_string(executed) + " DUPLICATE"});
  // A command that was delayed arrives after the E:CLEAR, and has no effect.
  const std::uint32_t under_way = host.pnum++;
  const std::uint32_t cleared = clear();
  EXPECT_EQ(board.state(), BoardState::active);
  board.log.refused.clear();
  host.resend("O:500,1,1", under_way);
  EXPECT_EQ(board.log.refused, Lines{std::to_string(under_way) + " STALE"});
  EXPECT_EQ(board.application->link().last_executed(), cleared);
  EXPECT_TRUE(board.safe());
}

TEST_F(ApplicationSafety, AStopIsAnsweredOnEveryPortAndToItsSender) {
  TestBoard two(Settings(), 2);
  TestHost owner(two, our_session, Source{0, 4});
  owner.connect();
  two.take(0);
  two.take(1);
  two.receive("E:STOP;PNum:1;T:1;", Source{1, 99});
  std::vector<Heard> first = two.take(0);
  std::vector<Heard> second = two.take(1);
  ASSERT_EQ(first.size(), 1U);
  EXPECT_EQ(first[0].peer, 4U);
  ASSERT_EQ(second.size(), 2U);
  EXPECT_EQ(second[0].peer, everyone);
  EXPECT_EQ(second[1].peer, 99U);
  for (const Heard& heard : {first[0], second[0], second[1]}) {
    EXPECT_EQ(heard.kind, MessageKind::board_heartbeat);
    EXPECT_NE(heard.bytes.find(";SAFE:2;"), std::string::npos);
  }
  // Each repetition is answered to its sender, so on a bad link the sender receives a confirmation.
  two.receive("E:STOP;PNum:1;T:1;", Source{1, 99});
  two.receive("E:STOP;PNum:1;T:1;", Source{0, 4});
  first = two.take(0);
  second = two.take(1);
  ASSERT_EQ(first.size(), 1U);
  EXPECT_EQ(first[0].peer, 4U);
  ASSERT_EQ(second.size(), 1U);
  EXPECT_EQ(second[0].peer, 99U);
}

TEST_F(ApplicationSafety, AStopIsObeyedBeforeAHostConnects) {
  TestBoard fresh;
  fresh.receive("E:STOP;PNum:1;T:1;", Source{0, 99});
  EXPECT_EQ(fresh.reason(), SafeReason::stop);
  EXPECT_EQ(fresh.state(), BoardState::connecting);
  TestHost first(fresh, our_session);
  fresh.run(20);
  first.connect();
  EXPECT_EQ(fresh.log.states.back(), "SAFE stop");
  first.command("O:1,1,1");
  EXPECT_TRUE(fresh.safe());
  first.clear();
  first.command("O:1,1,1");
  EXPECT_FALSE(fresh.safe());
}

TEST_F(ApplicationSafety, AStopIsObeyedWhileTheLinkIsLost) {
  board.run(1500);
  EXPECT_EQ(board.reason(), SafeReason::link);
  board.receive("E:STOP;PNum:1;T:1;", Source{0, 99});
  EXPECT_EQ(board.reason(), SafeReason::stop);
  host.echo();
  EXPECT_EQ(board.reason(), SafeReason::stop);
  EXPECT_TRUE(board.safe());
  clear();
  expect_nothing_restored();
}

TEST_F(ApplicationSafety, OnlyTheControllingHostClearsAStop) {
  host.command("E:STOP");
  board.receive("E:CLEAR;PNum:9;T:1;", Source{0, 99});
  EXPECT_EQ(board.reason(), SafeReason::stop);
  EXPECT_EQ(board.log.refused, Lines{"9 BUSY"});
}

TEST_F(ApplicationSafety, TakingControlDoesNotClearAStop) {
  host.command("E:STOP");
  board.run(1500);
  TestHost other(board, another_session, Source{0, 5});
  other.connect();
  EXPECT_EQ(board.reason(), SafeReason::stop);
}

TEST_F(ApplicationSafety, ARepeatedClearDoesNotClearALaterStop) {
  host.command("E:STOP");
  const std::uint32_t number = clear();
  host.command("E:STOP");
  host.resend("E:CLEAR", number);
  EXPECT_EQ(board.reason(), SafeReason::stop);
}

TEST_F(ApplicationSafety, ADelayedClearDoesNotClearANewerStop) {
  host.command("E:STOP");
  const std::string asked = host.clear_field();
  board.receive("E:STOP;PNum:1;T:1;", Source{0, 99});  // a second stop, from another peer
  board.log.refused.clear();
  std::uint32_t number = host.command(asked);
  EXPECT_EQ(board.reason(), SafeReason::stop);
  EXPECT_EQ(board.log.refused, Lines{std::to_string(number) + " STALE"});
  host.echo();  // the host may have the second cause and clear the first
  board.run(2000);
  host.connect();
  number = host.command(asked);
  EXPECT_EQ(board.reason(), SafeReason::stop);
  clear();
  EXPECT_EQ(board.state(), BoardState::active);
}

TEST_F(ApplicationSafety, ADelayedClearDoesNotClearANewerFault) {
  for (const SafeReason cause : {SafeReason::fault, SafeReason::watchdog}) {
    host.command("E:STOP");
    const std::string asked = host.clear_field();
    board.application->fail(cause, board.now_ms);
    host.command(asked);
    EXPECT_EQ(board.reason(), SafeReason::stop);
    clear();
    EXPECT_EQ(board.reason(), cause);
    const std::string again = host.clear_field();
    board.application->fail(cause, board.now_ms);
    host.command(again);
    EXPECT_EQ(board.reason(), cause);
    clear();
    EXPECT_EQ(board.state(), BoardState::active);
  }
}

TEST_F(ApplicationSafety, ARepeatedStopIsNotANewCause) {
  const std::uint32_t stop = host.command("E:STOP");
  const std::string asked = host.clear_field();
  host.resend("E:STOP", stop);
  host.command(asked);
  EXPECT_EQ(board.state(), BoardState::active);
  host.resend("E:STOP", stop);  // after the E:CLEAR, a repetition is a new cause
  EXPECT_EQ(board.reason(), SafeReason::stop);
  host.command(asked);
  EXPECT_EQ(board.reason(), SafeReason::stop);
}

TEST_F(ApplicationSafety, AStopWithoutANumberIsANewCauseEachTime) {
  board.receive("E:STOP;", Source{0, 99});
  const std::string asked = host.clear_field();
  board.receive("E:STOP;", Source{0, 99});
  host.command(asked);
  EXPECT_EQ(board.reason(), SafeReason::stop);
  clear();
  EXPECT_EQ(board.state(), BoardState::active);
}

TEST_F(ApplicationSafety, AClearWithoutACauseWorksOnlyAfterTheTimeout) {
  TestBoard fresh;
  TestHost paper(fresh, no_session);
  paper.heartbeat(4000);
  paper.command("E:STOP");
  for (int i = 0; i < 9; ++i) {
    fresh.run(100);
    paper.heartbeat(4000);
  }
  paper.command("E:CLEAR");
  EXPECT_EQ(fresh.reason(), SafeReason::stop);
  EXPECT_EQ(fresh.log.refused.size(), 1U);
  fresh.run(100);
  paper.command("E:CLEAR");
  EXPECT_EQ(fresh.state(), BoardState::active);
}

TEST_F(ApplicationSafety, AClearOfCauseZeroIsExecutedButClearsNoStop) {
  host.command("E:CLEAR,0");
  EXPECT_EQ(board.log.refused, Lines{});
  host.command("E:STOP");
  host.command("E:CLEAR,0");
  EXPECT_EQ(board.reason(), SafeReason::stop);
}

TEST_F(ApplicationSafety, EachBootNumbersItsCausesDifferently) {
  board.receive("E:STOP;", Source{0, 99});
  TestBoard other(Settings(), 1, 123'456'789);
  other.receive("E:STOP;", Source{0, 99});
  EXPECT_NE(other.newest_cause(), board.newest_cause());
}

TEST_F(ApplicationSafety, HeartbeatsNameTheNewestStop) {
  auto newest = [&] {
    const std::string bytes = board.take(MessageKind::board_heartbeat).back().bytes;
    Datagram datagram;
    EXPECT_TRUE(read_datagram(bytes, datagram));
    return heartbeat_report(datagram);
  };
  board.receive("E:STOP;PNum:77;T:1;", Source{0, 99});
  EXPECT_EQ(newest().stop, 77U);
  board.receive("E:STOP;PNum:78;T:1;", Source{0, 98});
  EXPECT_EQ(newest().stop, 78U);
  board.receive("E:STOP;PNum:77;T:1;", Source{0, 99});  // a late duplicate
  EXPECT_EQ(newest().stop, 77U);
  // A frame on a CAN bus reports a stop in this form.
  board.receive("E:STOP;STOP:200000;", Source{0, 99});
  EXPECT_EQ(newest().stop, 200000U);
  board.receive("E:STOP;", Source{0, 99});
  EXPECT_FALSE(newest().has_stop);
  board.receive("E:STOP;PNum:79;T:1;", Source{0, 99});
  clear();
  board.take();
  host.stay(600);
  EXPECT_FALSE(newest().has_stop);
}

TEST_F(ApplicationSafety, TheStateConfirmsAStopByItsNumber) {
  host.command("F:CMD");
  const std::uint32_t number = host.command("E:STOP");
  board.run(10);
  EXPECT_EQ(state_of(board.take(MessageKind::state).back()).last_command, number);
}

TEST_F(ApplicationSafety, EveryCauseIsReportedAtOnce) {
  auto told = [&](const char* reason) {
    const std::vector<Heard> heard = board.take(MessageKind::board_heartbeat);
    return heard.size() == 1 && heard[0].bytes.find(reason) != std::string::npos;
  };
  host.command("U:30,1");
  host.stay(400);
  board.take();
  distance(20);
  EXPECT_TRUE(told(";SAFE:4;"));
  handle(false);
  EXPECT_TRUE(told(";SAFE:3;"));
  board.application->fail(SafeReason::watchdog, board.now_ms);
  board.run(0);
  EXPECT_TRUE(told(";SAFE:5;"));
  board.application->fail(SafeReason::fault, board.now_ms);
  board.run(0);
  EXPECT_TRUE(told(";SAFE:6;"));
  host.command("E:STOP");
  EXPECT_TRUE(told(";SAFE:2;"));
}

TEST_F(ApplicationSafety, ClearRemovesOnlyTheReportedCause) {
  board.application->fail(SafeReason::watchdog, board.now_ms);
  board.application->fail(SafeReason::fault, board.now_ms);
  host.command("E:STOP");
  handle(false);
  EXPECT_EQ(board.reason(), SafeReason::stop);
  for (const SafeReason left :
       {SafeReason::fault, SafeReason::watchdog, SafeReason::handle, SafeReason::handle}) {
    clear();
    EXPECT_EQ(board.reason(), left);
    EXPECT_TRUE(board.safe());
  }
  handle(true);
  expect_nothing_restored();
}

TEST_F(ApplicationSafety, StateKeepsComingWhileStopped) {
  host.command("E:STOP");
  board.take();
  host.stay(100);
  const std::vector<Heard> heard = board.take(MessageKind::state);
  EXPECT_EQ(heard.size(), 10U);
  const State state = state_of(heard.back());
  EXPECT_EQ(state.safe, SafeReason::stop);
  EXPECT_EQ(state.raw.osmc[0].pwm, 0);  // the real state of the output, not the commanded state
}

// --- fault and watchdog

TEST_F(ApplicationSafety, AFaultIsLatchedAndRestoresNoOutputs) {
  for (const SafeReason cause : {SafeReason::fault, SafeReason::watchdog}) {
    host.command("O:358,1,1");
    EXPECT_FALSE(board.safe());
    board.application->fail(cause, board.now_ms);
    EXPECT_TRUE(board.safe());
    EXPECT_EQ(board.reason(), cause);
    host.stay(500);
    EXPECT_EQ(board.reason(), cause);
    clear();
    expect_nothing_restored();
  }
}

// --- handle

TEST_F(ApplicationSafety, TheBoardIsSafeUntilTheHandleIsHeldAgain) {
  handle(false);
  EXPECT_TRUE(board.safe());
  EXPECT_EQ(board.log.states, Lines{"SAFE handle"});
  host.command("O:1,1,1");
  EXPECT_TRUE(board.safe());
  clear();  // E:CLEAR does not clear a released handle
  EXPECT_EQ(board.reason(), SafeReason::handle);
  handle(true);
  EXPECT_EQ(board.log.states, (Lines{"SAFE handle", "ACTIVE none"}));
  expect_nothing_restored();
}

TEST_F(ApplicationSafety, AReleasedHandleIsNoticedWithin10Ms) {
  board.run(3);
  board.hal.inputs.handle = Handle::released;
  board.run(10);
  EXPECT_TRUE(board.safe());
}

TEST_F(ApplicationSafety, AHandleReleasedSinceTheLastPollBlocksACommand) {
  board.hal.inputs.handle = Handle::released;
  host.command("O:400,1,1");
  EXPECT_TRUE(board.safe());
  EXPECT_EQ(board.reason(), SafeReason::handle);
}

TEST_F(ApplicationSafety, AHandleReleasedBeforeConnectingKeepsTheBoardSafe) {
  TestBoard fresh;
  fresh.hal.inputs.handle = Handle::released;
  fresh.run(20);
  TestHost first(fresh, our_session);
  first.connect();
  first.command("O:1,1,1");
  EXPECT_TRUE(fresh.safe());
  EXPECT_EQ(fresh.log.states.back(), "SAFE handle");
}

TEST_F(ApplicationSafety, AHandleReleasedDuringAnOutageRestoresNoOutputs) {
  board.run(1500);
  handle(false);
  EXPECT_EQ(board.reason(), SafeReason::handle);
  handle(true);
  EXPECT_EQ(board.reason(), SafeReason::link);
  host.echo();
  expect_nothing_restored();
}

TEST_F(ApplicationSafety, AHandleReleasedAtRecoveryRestoresNoOutputs) {
  board.run(1500);
  board.hal.inputs.handle = Handle::released;
  const int changes = board.log.outputs;
  host.echo();
  EXPECT_TRUE(board.safe());
  EXPECT_EQ(board.log.outputs, changes);  // the outputs do not change even briefly
  handle(true);
  expect_nothing_restored();
}

// --- proximity

TEST_F(ApplicationSafety, AnObstacleKeepsTheBoardSafeUntil5CmBeyondTheThreshold) {
  host.command("U:30,1");
  distance(30);
  EXPECT_FALSE(board.safe());
  distance(29);
  EXPECT_TRUE(board.safe());
  EXPECT_EQ(board.log.states, Lines{"SAFE proximity"});
  distance(34);
  host.stay(600);
  EXPECT_EQ(board.reason(), SafeReason::proximity);
  distance(35);
  EXPECT_EQ(board.reason(), SafeReason::proximity);
  host.stay(480);
  EXPECT_EQ(board.reason(), SafeReason::proximity);
  host.stay(20);
  EXPECT_EQ(board.reason(), SafeReason::none);
  distance(34);
  EXPECT_EQ(board.reason(), SafeReason::none);  // the threshold of 30 cm applies again
  expect_nothing_restored();
}

TEST_F(ApplicationSafety, AMissingEchoIsNotAnObstacle) {
  host.command("U:30,1");
  distance(0);
  EXPECT_FALSE(board.safe());
}

TEST_F(ApplicationSafety, AMissedEchoDoesNotEndAnObstacle) {
  host.command("U:30,1");
  distance(20);
  for (int turn = 0; turn < 10; ++turn) {
    distance(0);
    host.stay(240);
    EXPECT_EQ(board.reason(), SafeReason::proximity);
    distance(20);
    host.stay(240);
  }
  distance(0);
  host.stay(500);
  EXPECT_EQ(board.reason(), SafeReason::none);
}

TEST_F(ApplicationSafety, EachSensorHasItsOwnThreshold) {
  host.command("U:30,1");
  host.command("U:10,4");
  board.hal.inputs.ultrasonic_cm[3] = 10;
  board.hal.inputs.ultrasonic_cm[1] = 1;  // sensor 2 has no threshold
  board.run(10);
  EXPECT_FALSE(board.safe());
  board.hal.inputs.ultrasonic_cm[3] = 9;
  board.run(10);
  EXPECT_EQ(board.reason(), SafeReason::proximity);
}

TEST_F(ApplicationSafety, AThresholdChangeTakesEffectAtOnce) {
  distance(20);
  host.command("U:21,1");
  EXPECT_TRUE(board.safe());
  host.command("U:0,1");
  EXPECT_EQ(board.state(), BoardState::active);
  expect_nothing_restored();
}

// --- several causes at once

TEST_F(ApplicationSafety, TheReasonIsInEveryHeartbeatAndState) {
  host.command("F:AIN24");
  handle(false);
  board.take();
  host.stay(1000);
  const std::vector<Heard> heard = board.take();
  EXPECT_GT(heard.size(), 100U);
  for (const Heard& one : heard) {
    EXPECT_NE(one.bytes.find(";SAFE:3;"), std::string::npos) << one.bytes;
  }
  handle(true);
  board.take();
  host.stay(1000);
  for (const Heard& one : board.take()) {
    EXPECT_EQ(one.bytes.find("SAFE"), std::string::npos) << one.bytes;
  }
}

// --- a fault of a chip

TEST_F(ApplicationSafety, AChipFaultIsReportedWithChipAndTrouble) {
  board.hal.inputs.fault = {64, ChipTrouble::no_acknowledge};
  board.hal.broken = true;
  host.stay(100);
  EXPECT_EQ(board.log.states, Lines{"SAFE fault"});
  const std::vector<Heard> states = board.take(MessageKind::state);
  ASSERT_FALSE(states.empty());
  const State state = test::state_of(states.back());
  EXPECT_EQ(state.safe, SafeReason::fault);
  EXPECT_EQ(state.fault, (ChipFault{64, ChipTrouble::no_acknowledge}));

  clear();  // executed, but the fault persists
  host.stay(100);
  EXPECT_EQ(board.reason(), SafeReason::fault);
  host.command("O:1,1,1");
  EXPECT_TRUE(board.safe());

  board.hal.broken = false;
  clear();
  host.stay(100);
  EXPECT_EQ(board.reason(), SafeReason::none);
  EXPECT_FALSE(
      test::state_of(board.take(MessageKind::state).back()).present.has(StateField::fault));
  expect_nothing_restored();
}

TEST_F(ApplicationSafety, ASilentSensorWithAThresholdIsAnObstacle) {
  board.hal.inputs.ultrasonic_blind = 0b0010;
  board.run(10);
  EXPECT_FALSE(board.safe());
  host.command("U:20,2");
  EXPECT_EQ(board.reason(), SafeReason::proximity);
  EXPECT_TRUE(board.safe());
  board.hal.inputs.ultrasonic_blind = 0;
  host.stay(520);
  EXPECT_EQ(board.reason(), SafeReason::none);
}

}  // namespace
}  // namespace r4
