// SPDX-License-Identifier: GPL-3.0-or-later
// One session over several paths, with the real board (docs/how-to/redundancy.md).
#include <gtest/gtest.h>

#include <algorithm>

#include "robot_on_paths.hpp"
#include "tests/support/datagrams.hpp"
#include "tests/support/signing.hpp"

namespace r4::test {
namespace {

using Cable = RobotOnPaths::Cable;
using Cables = RobotOnPaths::Cables;

bool executed_once(const RobotOnPaths& robot) {
  const auto& executed = robot.executed(0);
  return std::all_of(executed.begin(), executed.end(),
                     [](const auto& each) { return each.second == 1; });
}

TEST(SessionPaths, AskForTheIdentityOfTheBoardFirst) {
  RobotOnPaths robot(Cables{{5}, {5}});
  robot.plug(0, true);
  robot.plug(1, true);
  robot.run(9);
  for (const Cable& cable : robot.cables) {
    ASSERT_EQ(cable.sent.size(), 1U);
    EXPECT_EQ(cable.sent[0].substr(0, 5), "Q:ID;");
  }
  EXPECT_EQ(robot.session->path(0, robot.now()).state, PathState::asking);
  robot.run(500);
  EXPECT_TRUE(robot.session->in_control(robot.now()));
  EXPECT_EQ(robot.session->path(0, robot.now()).state, PathState::carrying);
  EXPECT_EQ(robot.session->path(1, robot.now()).state, PathState::carrying);
  EXPECT_EQ(robot.session->link().carrying, 3);
}

TEST_F(TwoPaths, CarryTheSameBytes) {
  robot.drive(100);
  EXPECT_EQ(robot.cables[0].all('H'), robot.cables[1].all('H'));
  EXPECT_EQ(robot.cables[0].all('O'), robot.cables[1].all('O'));
  EXPECT_EQ(robot.cables[0].all('O').size(), 1U);
  EXPECT_TRUE(executed_once(robot));
}

TEST_F(TwoPaths, BringEachStateOnce) {
  robot.told_states = 0;
  robot.run(1000);
  EXPECT_NEAR(static_cast<double>(robot.told_states), 100, 2);
  EXPECT_FALSE(robot.went_back);
  EXPECT_GT(robot.session->path(1, robot.now()).copies, 90U);
  EXPECT_EQ(robot.session->packets().lost, 0U);
  EXPECT_EQ(robot.session->path(0, robot.now()).loss(), 0);
  EXPECT_EQ(robot.session->path(1, robot.now()).loss(), 0);
  EXPECT_GT(robot.session->path(1, robot.now()).round_trip_us, 0);
}

TEST(SessionPaths, MissNothingWhileOnePathIsCutAThousandTimes) {
  RobotOnPaths robot(Cables{{1}, {2}});
  robot.connect();
  robot.run(500);
  robot.keeps_states = false;
  robot.oldest_age_ms = 0;
  robot.longest_gap_ms = 0;
  int unconfirmed = 0;
  for (int i = 0; i < 1000; ++i) {
    const auto path = static_cast<std::size_t>(i % 2);
    i % 4 < 2 ? robot.cut(path) : robot.plug(path, false);
    for (int n = 0; n < 3; ++n) {
      unconfirmed += robot.drive(i % 4096).outcome == Outcome::confirmed ? 0 : 1;
    }
    robot.run(10 + static_cast<std::uint32_t>(i * 7 % 40));
    i % 4 < 2 ? robot.cut(path, false) : robot.plug(path, true);
    robot.run(150);
    robot.results.clear();
    robot.links.clear();
  }
  EXPECT_EQ(unconfirmed, 0);
  EXPECT_TRUE(executed_once(robot));
  EXPECT_EQ(robot.trips, 0);
  EXPECT_LE(robot.longest_gap_ms, 20) << "at most two state periods";
  EXPECT_LE(robot.oldest_age_ms, 20U);
  EXPECT_FALSE(robot.went_back);
  EXPECT_EQ(robot.session->statistics(robot.now()).timed_out, 0U);
}

TEST_F(TwoPaths, ReportATransportThatIsDownAtOnceAndASilentPathWithinTheTimeout) {
  robot.plug(0, false);
  EXPECT_EQ(robot.links.back().carrying, 2);
  EXPECT_EQ(robot.session->path(0, robot.now()).state, PathState::down);
  EXPECT_FALSE(robot.links.back().causes.has(LinkCause::transport_down));
  EXPECT_EQ(robot.links.back().state, HostLinkState::active);
  robot.plug(0, true);
  robot.run(200);
  EXPECT_EQ(robot.links.back().carrying, 3);
  robot.cut(1);
  robot.run(990);
  EXPECT_EQ(robot.session->link().carrying, 3);
  robot.run(20);
  EXPECT_EQ(robot.session->link().carrying, 1);
  EXPECT_EQ(robot.session->path(1, robot.now()).state, PathState::silent);
  EXPECT_EQ(robot.session->link().state, HostLinkState::active);
  EXPECT_EQ(robot.trips, 0);
}

TEST(SessionPaths, TheLinkIsLostOnlyWithAllPathsAndRecoversWithOne) {
  RobotOnPaths robot(Cables{{1}, {1}, {1}});
  robot.connect();
  for (std::size_t path = 0; path < 3; ++path) robot.cut(path);
  robot.run(1100);
  EXPECT_EQ(robot.session->link().state, HostLinkState::lost);
  EXPECT_EQ(robot.session->link().carrying, 0);
  robot.cut(2, false);
  robot.run(1000);
  EXPECT_EQ(robot.session->link().carrying, 4);
  EXPECT_EQ(robot.drive(5).outcome, Outcome::confirmed);
  for (std::size_t path = 0; path < 3; ++path) robot.plug(path, false);
  EXPECT_TRUE(robot.session->link().causes.has(LinkCause::transport_down));
  EXPECT_EQ(robot.session->link().state, HostLinkState::lost);
  robot.cut(0, false);
  robot.plug(0, true);
  robot.run(1000);
  EXPECT_FALSE(robot.session->link().causes.has(LinkCause::transport_down));
  EXPECT_EQ(robot.drive(6).outcome, Outcome::confirmed);
}

TEST_F(TwoPaths, ConfirmACommandSentOnOnePathAndAnsweredOnTheOther) {
  robot.cables[0].cut_to_host = true;
  robot.cables[1].cut_to_board = true;
  for (int i = 0; i < 10; ++i) EXPECT_EQ(robot.drive(i).outcome, Outcome::confirmed);
  EXPECT_TRUE(executed_once(robot));
}

TEST_F(TwoPaths, ReportARefusalOnce) {
  robot.nacks.clear();
  robot.drive(1);
  EXPECT_TRUE(robot.nacks.empty()) << "the answer to a duplicate must not be reported";
  const Ticket ticket = robot.send(Command::setting("timeout", "100"));
  // Out of range: the timeout must exceed the heartbeat interval.
  const CommandResult result = robot.finish(ticket);
  EXPECT_EQ(result.outcome, Outcome::refused);
  EXPECT_EQ(result.code, Refusal::range);
  robot.run(50);
  EXPECT_EQ(robot.nacks.size(), 1U);
}

// AUTH refuses one duplicate of a command. The duplicate on another path may have been executed,
// also before that path was unplugged.
TEST_F(TwoPaths, AuthOnOneEndsNoCommand) {
  for (const std::size_t path : {0U, 1U}) robot.cut(path);
  const Ticket ticket = robot.send(Command::setting("node", "3"));
  robot.run(5);
  Datagram first;
  Datagram command;
  ASSERT_TRUE(read_datagram(robot.cables[0].all('H').front(), first));
  ASSERT_TRUE(read_datagram(robot.cables[0].all('C').back(), command));
  const std::string refused = with_crc(
      "N:" + std::to_string(command.pnum()) + ",AUTH;SESSION:" + std::to_string(first.pnum()) +
      ";SID:0000000000000065;PNum:1;T:" + std::to_string(robot.board_ms(0)) + ";");
  robot.bring(0, refused);
  EXPECT_EQ(robot.results.count(ticket), 0U);
  robot.plug(1, false);
  robot.bring(0, refused);
  EXPECT_EQ(robot.results.count(ticket), 0U);
  EXPECT_EQ(robot.finish(ticket).outcome, Outcome::timed_out);
}

TEST_F(TwoPaths, AreBusyOnlyIfBusyOnBothUntilAStateShowsControl) {
  Datagram heartbeat;
  ASSERT_TRUE(read_datagram(robot.cables[0].all('H').back(), heartbeat));
  const std::string busy =
      with_crc("N:" + std::to_string(heartbeat.pnum()) +
               ",BUSY;SID:0000000000000065;PNum:1;T:" + std::to_string(robot.board_ms(0)) + ";");
  robot.bring(1, busy);
  EXPECT_FALSE(robot.session->link().causes.has(LinkCause::busy));
  EXPECT_TRUE(robot.session->path(1, robot.now()).busy);
  robot.bring(0, busy);
  EXPECT_TRUE(robot.session->link().causes.has(LinkCause::busy));
  robot.run(30);
  EXPECT_FALSE(robot.session->link().causes.has(LinkCause::busy));
  EXPECT_TRUE(robot.session->in_control(robot.now()));
  for (const std::size_t path : {0U, 1U}) robot.bring(path, busy);
  EXPECT_FALSE(robot.session->link().causes.has(LinkCause::busy))
      << "a BUSY older than the proof of control must have no effect";
}

TEST(SessionPaths, AreRefusedWhileTheyLeadToTwoBoards) {
  for (const std::size_t moved : {0U, 1U}) {
    RobotOnPaths robot(Cables{{1}, {1, 1}});
    robot.connect();
    EXPECT_EQ(robot.session->link().cause(), LinkCause::two_boards);
    EXPECT_EQ(robot.session->path(1, robot.now()).state, PathState::other_board);
    EXPECT_EQ(robot.session->path(0, robot.now()).board_id, "board-0");
    EXPECT_EQ(robot.session->path(1, robot.now()).board_id, "board-1");
    robot.send(Command::osmc(1, Pwm(1), Direction::forward));
    robot.run(1000);
    for (const Cable& cable : robot.cables) {
      ASSERT_FALSE(cable.sent.empty());
      EXPECT_EQ(cable.all('Q').size(), cable.sent.size())
          << "only questions may be sent to another board";
    }
    robot.plug(moved, false);
    robot.cables[moved].board = 1 - moved;  // plugged into the board of the other path
    robot.plug(moved, true);
    robot.run(1000);
    EXPECT_TRUE(robot.session->link().causes.empty()) << moved;
    EXPECT_TRUE(robot.session->in_control(robot.now())) << moved;
    EXPECT_EQ(robot.session->path(moved, robot.now()).board_id,
              "board-" + std::to_string(1 - moved));
  }
}

TEST(SessionPaths, ContinueWhenOnePathLeadsToAnotherBoard) {
  RobotOnPaths robot(Cables{{1}, {1}, {1, 1}});
  robot.plug(0, true);
  robot.plug(1, true);
  robot.run(500);
  ASSERT_TRUE(robot.session->in_control(robot.now()));
  robot.plug(2, true);
  robot.run(500);
  EXPECT_EQ(robot.session->link().cause(), LinkCause::other_board);
  EXPECT_EQ(robot.drive(3).outcome, Outcome::confirmed);
  EXPECT_TRUE(robot.executed(1).empty());
  EXPECT_EQ(robot.cables[2].all('Q').size(), robot.cables[2].sent.size());
}

TEST(SessionPaths, TheSessionBeginsWithoutASilentPath) {
  RobotOnPaths robot(Cables{{1}, {1}});
  robot.cut(1);
  robot.connect();
  EXPECT_TRUE(robot.session->in_control(robot.now()));
  EXPECT_EQ(robot.session->path(1, robot.now()).state, PathState::asking);
  EXPECT_EQ(robot.cables[1].all('Q').size(), robot.cables[1].sent.size());
  robot.cut(1, false);
  robot.run(200);
  EXPECT_EQ(robot.session->link().carrying, 3);
}

TEST_F(TwoPaths, ReportEachPartOfAStateOnce) {
  robot.run(3);
  const std::string t = std::to_string(robot.board_ms(0) + 1);
  robot.states.clear();
  robot.bring(0, with_crc("AIN24:1.00;SAFE:0;PNum:90001;T:" + t + ";"));
  robot.bring(1, with_crc("AIN24:1.00;SAFE:0;PNum:70001;T:" + t + ";"));
  robot.bring(1, with_crc("AIN12:2.00;SAFE:0;PNum:70002;T:" + t + ";"));
  robot.bring(0, with_crc("AIN12:2.00;SAFE:0;PNum:90002;T:" + t + ";"));
  ASSERT_EQ(robot.states.size(), 2U) << "each part must be reported once";
  EXPECT_EQ(robot.states[1].raw.analog_cv[static_cast<int>(StateField::ain12)], 200);
  EXPECT_EQ(robot.states[1].raw.analog_cv[static_cast<int>(StateField::ain24)], 100);
}

TEST_F(TwoPaths, CountADatagramAsLostOnlyIfBothPathsLoseIt) {
  robot.run(100);
  robot.cut(0);
  robot.run(100);
  robot.cut(0, false);
  robot.run(100);
  EXPECT_NEAR(robot.session->path(0, robot.now()).packets.lost, 10, 2);
  EXPECT_EQ(robot.session->packets().lost, 0U);
  robot.cut(0);
  robot.cut(1);
  robot.run(100);
  robot.cut(0, false);
  robot.cut(1, false);
  robot.run(100);
  EXPECT_NEAR(robot.session->packets().lost, 10, 2);
}

TEST(SessionPaths, AllPathsCarryAStopEvenToAnUnknownBoard) {
  RobotOnPaths robot(Cables{{1}, {1}});
  robot.plug(0, true);
  robot.plug(1, true);
  const Ticket ticket = robot.send(Command::stop());
  for (const std::size_t path : {0U, 1U}) {
    EXPECT_EQ(robot.cables[path].all('E').size(), 1U)
        << "a stop goes to every path, even before its board is known";
  }
  EXPECT_EQ(robot.finish(ticket).outcome, Outcome::confirmed);
}

TEST(SessionPaths, EachPathSignsWithItsOwnSignature) {
  SessionOptions options = RobotOnPaths::at_will();
  options.key = key_of(1);
  options.clock_start = std::chrono::hours{24};
  RobotOnPaths robot(Cables{{1}, {20}}, options, BoardRole::control, settings_with(key_of(1)));
  robot.connect();
  robot.run(1000);
  ASSERT_TRUE(robot.session->in_control(robot.now()));
  EXPECT_EQ(robot.drive(9).outcome, Outcome::confirmed);
  const std::string first = robot.cables[0].all('O')[0];
  const std::string second = robot.cables[1].all('O')[0];
  const std::size_t signature = first.find(";A:1,");
  ASSERT_NE(signature, std::string::npos);
  EXPECT_EQ(first.substr(0, signature), second.substr(0, signature));
  EXPECT_NE(first, second);
  EXPECT_EQ(robot.session->link().carrying, 3);
}

}  // namespace
}  // namespace r4::test
