// SPDX-License-Identifier: GPL-3.0-or-later
// A farewell: its effect on the outputs, on control, and on the commands that arrive after it.
#include <gtest/gtest.h>

#include "tests/firmware/board_fixture.hpp"
#include "tests/support/signing.hpp"

namespace r4 {
namespace {

using firmware::BoardState;
using test::another_session;
using test::our_session;
using test::TestBoard;
using test::TestHost;
using Lines = std::vector<std::string>;

struct ApplicationFarewell : test::BoardInControl {
  static void leave(TestHost& from, std::uint32_t pnum) { from.resend("E:LEAVE", pnum); }
  TestHost other{board, another_session, Source{0, 5}};
};

TEST_F(ApplicationFarewell, MakesTheOutputsSafeAndReleasesControlAtOnce) {
  host.command("O:358,1,1");
  const int made_safe = board.hal.made_safe;
  leave(host, host.pnum++);
  EXPECT_TRUE(board.safe());
  EXPECT_EQ(board.hal.made_safe, made_safe + 1);
  EXPECT_EQ(board.log.states.back(), "SAFE link");
  board.run(1);
  EXPECT_EQ(board.take(MessageKind::board_heartbeat).back().at_ms, board.now_ms - 1)
      << "the board reports it at once";
  other.connect();
  EXPECT_EQ(board.state(), BoardState::active);
  EXPECT_EQ(board.outputs().osmc[0].pwm, 0);
  other.command("O:5,1,2");
  EXPECT_EQ(board.outputs().osmc[1].pwm, 5);
}

TEST_F(ApplicationFarewell, RestoresNoOutputsForTheSameHost) {
  host.command("O:358,1,1");
  leave(host, host.pnum++);
  board.run(1);
  host.connect();
  EXPECT_EQ(board.reason(), SafeReason::link) << "the session is over";
  host.sid = another_session;
  host.connect();
  EXPECT_EQ(board.state(), BoardState::active);
  EXPECT_EQ(board.outputs().osmc[0].pwm, 0);
}

TEST_F(ApplicationFarewell, IsRefusedFromAnotherHost) {
  host.command("O:358,1,1");
  forget();
  leave(other, other.pnum++);
  EXPECT_EQ(answers(), (Lines{"BUSY"}));
  EXPECT_EQ(board.outputs().osmc[0].pwm, 358);
}

TEST_F(ApplicationFarewell, DoesNotEndTheNextSessionIfLateOrRepeated) {
  const std::uint32_t number = host.pnum++;
  leave(host, number);
  forget();
  leave(host, number);
  EXPECT_EQ(answers(), (Lines{"DUPLICATE"})) << "the host learns that its farewell was executed";
  board.run(1);
  TestHost next(board, another_session,
                host.at);  // the old farewell would fit the numbers of this session
  next.connect();
  next.command("O:358,1,1");
  forget();
  leave(host, number);
  leave(host, next.pnum);
  EXPECT_EQ(answers(), (Lines{"BUSY", "BUSY"}));
  EXPECT_EQ(board.outputs().osmc[0].pwm, 358);
  leave(next, next.pnum);
  EXPECT_TRUE(board.safe());
}

TEST_F(ApplicationFarewell, IsRefusedFromAPaperHost) {
  TestBoard paper_board;
  TestHost paper(paper_board, no_session);
  paper.heartbeat(5);
  paper.command("O:358,1,1");
  paper.command("E:LEAVE");
  EXPECT_EQ(paper_board.outputs().osmc[0].pwm, 358);
}

TEST_F(ApplicationFarewell, LeavesAStopLatched) {
  host.command("E:STOP");
  leave(host, host.pnum++);
  EXPECT_EQ(board.application->reason(), SafeReason::stop);
  EXPECT_FALSE(board.application->link().has_owner());
}

// --- a board with a key

struct SignedFarewell : testing::Test {
  // Sends a signed datagram and returns it, so that a test can replay it.
  std::string say(const std::string& field, std::uint32_t t) {
    Datagram heartbeat;
    for (const test::MemoryPort::Sent& sent : board.ports[0].sent) {
      Datagram datagram;
      if (!read_datagram(sent.bytes, datagram) || heartbeat_nonce(datagram).empty()) continue;
      nonce = test::str(heartbeat_nonce(datagram));
    }
    const std::string text = field + ";" + test::stamp_of(sid, pnum++, t);
    const std::string whole =
        test::with_signature(text, test::key_of(1), nonce, ++counter, board.now_ms);
    board.receive(whole, at);
    return whole;
  }
  void drive() {
    board.run(600);
    say("H:ROS2-R4", 0);
    say("H:ROS2-R4", board.newest_t());
    say("O:358,1,1", 1);
    ASSERT_EQ(board.outputs().osmc[0].pwm, 358);
  }

  TestBoard board{test::settings_with(test::key_of(1))};
  Source at{0, 7};
  std::uint32_t pnum = 7;
  SessionId sid = our_session;
  std::uint64_t counter = 1000;
  std::string nonce;
};

TEST_F(SignedFarewell, IsObeyedOnlyIfSigned) {
  drive();
  board.receive("E:LEAVE;" + test::stamp_of(sid, pnum, board.newest_t()), at);
  EXPECT_EQ(board.outputs().osmc[0].pwm, 358);
  EXPECT_EQ(board.log.rejected, Lines{"missing"});
  say("E:LEAVE", board.newest_t());
  EXPECT_TRUE(board.safe());
  EXPECT_FALSE(board.application->link().has_owner());
}

TEST_F(SignedFarewell, DoesNotEndASessionWhenReplayed) {
  drive();
  const std::string farewell = say("E:LEAVE", board.newest_t());
  board.run(10);
  sid = another_session;
  drive();
  const std::uint16_t pwm = board.outputs().osmc[0].pwm;
  board.receive(farewell, at);
  EXPECT_EQ(board.outputs().osmc[0].pwm, pwm);
  EXPECT_TRUE(board.application->link().has_owner());
}

}  // namespace
}  // namespace r4
