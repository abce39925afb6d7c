// SPDX-License-Identifier: GPL-3.0-or-later
// The commands that move an output, and the answers to the other commands.
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

using ApplicationCommand = test::BoardInControl;

TEST_F(ApplicationCommand, EveryOutputFollowsItsCommand) {
  for (const char* field : {"R:1,On", "O:4095,1,1", "O:1,0,4", "D:7,1,2", "S:2500,16", "R:8,1",
                            "R:2,on", "R:2,Off", "P:-100,20000,1", "P:5,4", "B:4095,1,1,3"}) {
    host.command(field);
  }
  EXPECT_EQ(board.log.refused, Lines());
  firmware::Outputs expected;
  expected.osmc[0] = {4095, Direction::forward};
  expected.osmc[3] = {1, Direction::reverse};
  expected.dhb12[1] = {7, Direction::forward};
  expected.servo_us[15] = 2500;
  expected.relays = 0x81;
  expected.stepper[0].position = -100;
  expected.stepper[0].speed = 20000;
  expected.stepper[0].enabled = true;
  expected.stepper[3].position = 5;
  expected.stepper[3].speed = 1000;
  expected.stepper[3].enabled = true;
  expected.bldc[2] = {4095, Direction::forward, true};
  EXPECT_EQ(board.outputs(), expected);
}

TEST_F(ApplicationCommand, RefusesInvalidCommands) {
  const std::pair<const char*, const char*> cases[] = {
      {"X:1", "UNKNOWN"},        {"E:HALT", "UNKNOWN"},         {"H:HELLO", "UNKNOWN"},
      {"Q:WHO", "UNKNOWN"},      {"O:1,1", "FORMAT"},           {"O:1,1,1,1", "FORMAT"},
      {"O:a,1,1", "FORMAT"},     {"O:,1,1", "FORMAT"},          {"O:5000,1,1", "RANGE"},
      {"O:-1,1,1", "RANGE"},     {"O:1,2,1", "RANGE"},          {"O:1,1,5", "CHANNEL"},
      {"O:1,1,0", "CHANNEL"},    {"D:4096,1,1", "RANGE"},       {"D:1,1,5", "CHANNEL"},
      {"S:2501,1", "RANGE"},     {"S:1,17", "CHANNEL"},         {"R:9,On", "CHANNEL"},
      {"R:1,Maybe", "FORMAT"},   {"P:1,0,1", "RANGE"},          {"P:1,20001,1", "RANGE"},
      {"P:1,5", "CHANNEL"},      {"P:2147483648,1", "RANGE"},   {"Z:5", "CHANNEL"},
      {"B:4096,1,0,1", "RANGE"}, {"B:1,1,2,1", "RANGE"},        {"B:1,1,1,5", "CHANNEL"},
      {"U:401,1", "RANGE"},      {"U:1,5", "CHANNEL"},          {"F:", "FORMAT"},
      {"F:AIN25", "UNKNOWN"},    {"F:AIN24,", "UNKNOWN"},       {"C:colour,red", "UNKNOWN"},
      {"C:rate,0", "RANGE"},     {"C:rate,fast", "FORMAT"},     {"C:rate", "FORMAT"},
      {"E:STOP,1", "FORMAT"},    {"O:1,1,1;O:2,1,1", "FORMAT"},
  };
  const Settings before = board.application->settings();
  for (const auto& [field, code] : cases) {
    host.command(field);
    EXPECT_EQ(answers(), Lines{code}) << field;
  }
  EXPECT_TRUE(board.safe());
  EXPECT_EQ(board.state(), BoardState::active);
  EXPECT_EQ(board.log.executed.size(), 0U);
  EXPECT_EQ(board.application->settings().state_rate_hz, before.state_rate_hz);
}

TEST_F(ApplicationCommand, ExecutesEachCommandNumberOnce) {
  const std::uint32_t number = host.command("P:100,1");
  for (int i = 0; i < 3; ++i) host.resend("P:100,1", number);
  EXPECT_EQ(board.log.executed, std::vector<std::uint32_t>{number});
  EXPECT_EQ(answers(), (Lines{"DUPLICATE", "DUPLICATE", "DUPLICATE"}));
}

TEST_F(ApplicationCommand, RefusesCommandsSentBeforeTheSession) {
  TestBoard fresh;
  TestHost again(fresh, our_session);
  again.heartbeat(0);
  const std::uint32_t early = again.command("O:1,1,1");
  EXPECT_TRUE(fresh.safe());
  again.echo();
  again.resend("O:1,1,1", early);
  EXPECT_TRUE(fresh.safe());
  EXPECT_EQ(fresh.log.refused,
            (Lines{std::to_string(early) + " SAFE", std::to_string(early) + " STALE"}));
  again.command("O:2,1,1");
  EXPECT_EQ(fresh.outputs().osmc[0].pwm, 2);
}

TEST_F(ApplicationCommand, AnEchoOfAnotherBootStartsNoSession) {
  TestBoard fresh;
  TestHost again(fresh, our_session);
  again.heartbeat(0);
  again.heartbeat(board.newest_t() + 77);
  again.heartbeat(fresh.now_ms + 1);
  again.heartbeat(std::uint64_t{fresh.newest_t()} + (std::uint64_t{1} << 32));
  again.command("O:1,1,1");
  EXPECT_TRUE(fresh.safe());
}

TEST_F(ApplicationCommand, ACommandRefusedInAnOutageStaysRefused) {
  board.run(1500);
  const std::uint32_t overtaken = host.pnum++;  // the heartbeat arrives after the command
  const std::uint32_t refused = host.command("O:1,1,1");
  EXPECT_EQ(answers(), Lines{"SAFE"});
  board.receive("H:ROS2-R4;" + test::stamp_of(our_session, overtaken, board.newest_t()), host.at);
  ASSERT_EQ(board.state(), BoardState::active);
  host.resend("O:1,1,1", refused);
  EXPECT_TRUE(board.safe());
  EXPECT_EQ(answers(), Lines{"SAFE"});
}

TEST_F(ApplicationCommand, OnlyStopHeartbeatAndIdentifyNeedNoPacketNumber) {
  for (const char* field :
       {"O:1,1,1;", "E:CLEAR;", "F:ALL;", "C:rate,10;", "X:1;", "O:9999,1,1;"}) {
    board.receive(field, host.at);
  }
  EXPECT_TRUE(board.safe());
  EXPECT_EQ(answers(), Lines());
  EXPECT_EQ(board.application->settings().state_rate_hz, 100);
  board.receive("Q:ID;", Source{0, 9});
  EXPECT_EQ(board.take(MessageKind::identity).size(), 1U);
  board.receive("E:STOP;", Source{0, 9});
  EXPECT_EQ(board.reason(), SafeReason::stop);
}

TEST_F(ApplicationCommand, ReportsTheNewestExecutedNumber) {
  host.command("F:SAFE,CMD");
  const std::uint32_t number = host.command("O:1,1,1");
  host.command("O:9999,1,1");
  board.take();
  board.run(10);
  EXPECT_EQ(state_of(board.take(MessageKind::state).back()).last_command, number);
}

TEST_F(ApplicationCommand, AnswersThePeerThatAsked) {
  TestBoard two(Settings(), 2);
  TestHost owner(two, our_session, Source{0, 4});
  owner.connect();
  two.take(0);
  two.take(1);
  two.receive("O:9999,1,1;PNum:5;T:1;", Source{1, 8});
  two.receive("Q:ID;PNum:6;T:1;", Source{1, 9});
  owner.command("O:9999,1,1");
  const std::vector<Heard> first = two.take(0);
  const std::vector<Heard> second = two.take(1);
  ASSERT_EQ(first.size(), 1U);
  EXPECT_EQ(first[0].peer, 4U);
  ASSERT_EQ(second.size(), 2U);
  EXPECT_EQ(second[0].kind, MessageKind::nack);
  EXPECT_EQ(second[0].peer, 8U);
  EXPECT_EQ(second[1].kind, MessageKind::identity);
  EXPECT_EQ(second[1].peer, 9U);
}

TEST_F(ApplicationCommand, AnswersIdentifyInEveryState) {
  const std::string answer = "I:R4,1.2.3,R4-7,udp+serial+leave+group+watch+dac;";
  TestBoard fresh;
  fresh.take();
  fresh.receive("Q:ID;PNum:6;T:1;", Source{0, 9});
  std::vector<Heard> heard = fresh.take();
  ASSERT_EQ(heard.size(), 1U);
  EXPECT_EQ(heard[0].bytes.rfind(answer, 0), 0U);
  EXPECT_EQ(fresh.state(), BoardState::connecting);

  board.run(1500);
  board.take();
  host.command("Q:ID");
  heard = board.take(MessageKind::identity);
  ASSERT_EQ(heard.size(), 1U);
  EXPECT_EQ(heard[0].bytes.rfind(answer, 0), 0U);
}

TEST_F(ApplicationCommand, LimitsIdentityAnswersToUnprovenHosts) {
  std::size_t identities = 0;
  for (int i = 0; i < 1000; ++i) {
    board.take();
    board.receive("Q:ID;", Source{0, 1000U + static_cast<std::uint32_t>(i)});
    identities += board.take(MessageKind::identity).size();
    board.run(1);
  }
  EXPECT_GE(identities, 16U + 45U);
  EXPECT_LE(identities, 16U + 55U);
  board.take();
  board.receive("Q:ID;", host.at);
  EXPECT_EQ(board.take(MessageKind::identity).size(), 1U) << "the controlling host gets its answer";
}

TEST_F(ApplicationCommand, ObeysAndAnswersEveryStop) {
  for (std::uint32_t peer = 1000; peer < 2000; ++peer) {
    board.take();
    const std::string stop = "E:STOP;PNum:" + std::to_string(peer) + ";T:0;";
    board.receive(stop, Source{0, peer});
    EXPECT_EQ(board.reason(), SafeReason::stop);
    int answers = 0;
    for (const Heard& heard : board.take(MessageKind::board_heartbeat)) {
      if (heard.peer != peer) continue;
      ++answers;
      EXPECT_NE(heard.bytes.find(";STOP:" + std::to_string(peer) + ";"), std::string::npos);
    }
    EXPECT_EQ(answers, 1);
  }
}

TEST_F(ApplicationCommand, TheIdentityReportsWhetherAnotherHostHasControl) {
  const auto identity = [this](Source from, SessionId sid = no_session) {
    board.take();
    board.receive("Q:ID;" + test::stamp_of(sid, 1, 1), from);
    const std::vector<Heard> heard = board.take(MessageKind::identity);
    EXPECT_EQ(heard.size(), 1U);
    return heard.empty() ? std::string() : heard[0].bytes;
  };
  const Source stranger{0, 99};
  EXPECT_NE(identity(stranger).find(";BUSY:1;"), std::string::npos);
  EXPECT_NE(identity(host.at, host.sid).find(";BUSY:0;"), std::string::npos);
  board.run(1500);  // the link is lost, so any host may take control
  EXPECT_NE(identity(stranger).find(";BUSY:0;"), std::string::npos);
}

TEST_F(ApplicationCommand, TheIdentityNamesThePacketNumberOfItsQuestion) {
  board.take();
  board.receive("Q:ID;PNum:4294967295;T:3;", host.at);
  board.receive("Q:ID;", host.at);
  const std::vector<Heard> heard = board.take(MessageKind::identity);
  ASSERT_EQ(heard.size(), 2U);
  EXPECT_NE(heard[0].bytes.find(";ASKED:4294967295;"), std::string::npos);
  EXPECT_EQ(heard[1].bytes.find("ASKED"), std::string::npos) << "the question has no number";
}

TEST_F(ApplicationCommand, IgnoresDatagramsOfOtherBoards) {
  for (const char* fields : {"H:R4-ROS2;PNum:1;T:1;", "N:5,SAFE;PNum:1;T:1;",
                             "I:R4,1,2,3;PNum:1;T:1;", "AIN24:24.28;PNum:1;T:1;", "PNum:1;T:1;"}) {
    board.receive(fields, host.at);
  }
  EXPECT_EQ(board.take(MessageKind::nack).size(), 0U);
  EXPECT_EQ(board.log.executed.size(), 0U);
  board.run(900);
  board.receive("H:R4-ROS2;PNum:1;T:1;", host.at);
  board.run(100);
  EXPECT_EQ(board.reason(), SafeReason::link);
}

TEST_F(ApplicationCommand, ZeroResetsTheCountAndHoldsTheStepper) {
  host.command("P:1000,2");
  host.command("Z:2");
  EXPECT_EQ(board.hal.zeroed, std::vector<int>{2});
  EXPECT_FALSE(board.outputs().stepper[1].enabled);
  host.command("Z:9");
  EXPECT_EQ(board.hal.zeroed.size(), 1U);
}

TEST_F(ApplicationCommand, CountsReceivedLostDuplicateAndRefusedDatagrams) {
  host.command("F:RXOK,RXCRC,RXLOST,RXDUP,RXREF");
  board.take();
  board.run(10);
  const State before = state_of(board.take(MessageKind::state).back());
  const std::uint32_t number = host.command("S:1,1");
  host.resend("S:1,1", number);
  host.pnum += 3;
  host.command("S:9999,1");
  board.receive_raw("noise", host.at);
  board.run(10);
  const State after = state_of(board.take(MessageKind::state).back());
  EXPECT_EQ(after.rx_ok - before.rx_ok, 3U);
  EXPECT_EQ(after.rx_crc - before.rx_crc, 1U);
  EXPECT_EQ(after.rx_lost - before.rx_lost, 3U);
  EXPECT_EQ(after.rx_duplicate - before.rx_duplicate, 1U);
  EXPECT_EQ(after.rx_refused - before.rx_refused, 2U);
}

// --- hosts whose heartbeats have no number, as in the paper's capture

TEST(ApplicationWithoutNumbers, BeginsANewSessionAfterAnOutage) {
  TestBoard board;
  board.receive("H:ROS2-R4;T:1;");
  board.receive("O:358,1,1;PNum:6600;T:1;");
  EXPECT_EQ(board.outputs().osmc[0].pwm, 358);
  board.receive("O:1,1,1;PNum:6600;T:1;");
  board.receive("O:2,1,1;PNum:6599;T:1;");
  EXPECT_EQ(board.log.refused, (Lines{"6600 DUPLICATE", "6599 STALE"}));
  board.run(1500);
  board.receive("H:ROS2-R4;T:1;");  // the host may have restarted; its clock counts from 0
  EXPECT_EQ(board.state(), BoardState::active);
  EXPECT_TRUE(board.safe());
  board.receive("S:1500,1;PNum:0;T:1;");
  EXPECT_EQ(board.outputs().servo_us[0], 1500);
  EXPECT_EQ(board.outputs().osmc[0].pwm, 0);
}

}  // namespace
}  // namespace r4
