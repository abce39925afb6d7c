// SPDX-License-Identifier: GPL-3.0-or-later
// The datagrams that one path of a session admits, and which of them are new, without a session.
// tests/host/session/session_paths_test.cpp tests several paths.
#include "host/paths/paths.hpp"

#include <gtest/gtest.h>

#include <string_view>

namespace r4 {
namespace {

using Admission = Paths::Admission;

struct OnePath : testing::Test {
  OnePath() {
    paths.on_transport(0, true, true, now);
    paths.poll(now);
  }
  std::uint32_t board_t() const { return to_ms(now) + board_offset; }
  Admission state() {
    const Admission admission = paths.admit(0, board_pnum++, board_t(), now);
    if (admission != Admission::no) paths.is_newest(0, board_t(), now);
    return admission;
  }
  // Handles a heartbeat as a session does. Returns true if the heartbeat is new.
  bool heartbeat(std::uint32_t t_ms, std::uint32_t pnum) {
    const Admission admission = paths.admit(0, pnum, t_ms, now);
    if (admission == Admission::restarted) link.on_restart();
    if (admission == Admission::no || !paths.news().take_heartbeat(0, t_ms)) return false;
    link.on_heartbeat(t_ms);
    if (paths.is_newest(0, t_ms, now)) link.on_reason(SafeReason::none, to_ms(now));
    return true;
  }
  bool heartbeat() { return heartbeat(board_t(), board_pnum++); }
  bool booting() { return paths.admit_connecting(0, now); }
  void pass(int ms) { now += std::chrono::milliseconds{ms}; }
  void ask() { paths.asked(0, ++question, true, now); }
  Admission answer(std::string_view board_id = "board") {
    Identity identity{Text("0.1.0"), Text(board_id), Text("udp")};
    identity.has_asked = true;
    identity.asked = question;
    return paths.admit_identity(0, identity, board_t(), now);
  }
  void reboot() {
    board_offset += 1'000'000'000;
    board_pnum = 1;
  }

  HostLink link{LinkTiming{}, 7};
  Paths paths{1, LinkTiming{}, link};
  Time now = std::chrono::seconds{5};
  std::uint32_t board_offset = 123'456;
  std::uint32_t board_pnum = 1;
  std::uint32_t question = 100;
};

// The board has sent a heartbeat, and has answered a question.
struct AnsweredPath : OnePath {
  AnsweredPath() {
    heartbeat();
    ask();
    EXPECT_EQ(answer(), Admission::yes);
  }
};

TEST_F(OnePath, OlderDatagramsAndDuplicatesAreDropped) {
  EXPECT_TRUE(heartbeat());
  EXPECT_TRUE(heartbeat()) << "packet numbers order the heartbeats of one millisecond";
  EXPECT_FALSE(heartbeat(board_t(), board_pnum - 1)) << "the same heartbeat again";
  EXPECT_FALSE(heartbeat(board_t(), board_pnum - 2)) << "a late heartbeat";
  pass(100);
  ASSERT_TRUE(heartbeat(board_t(), 10));
  EXPECT_FALSE(heartbeat(board_t() - 20, 5));
  EXPECT_FALSE(paths.is_newest(0, board_t() - 1, now));
  FieldSet fields;
  fields.add(StateField::safe);
  ASSERT_TRUE(paths.news().take_state(0, board_t(), fields));
  EXPECT_FALSE(paths.news().take_state(0, board_t(), fields)) << "this state has come already";
  EXPECT_FALSE(paths.news().is_newest_state(0, board_t() - 1));
}

TEST_F(OnePath, ALateDatagramIsSubtractedFromTheLostOnes) {
  heartbeat(board_t(), 10);
  pass(10);
  heartbeat(board_t(), 14);
  EXPECT_EQ(paths.counters().lost, 3U);
  heartbeat(board_t() - 5, 12);
  EXPECT_EQ(paths.counters().lost, 2U);
  EXPECT_EQ(paths.counters().late, 1U);
  heartbeat(board_t() - 5, 12);
  EXPECT_EQ(paths.counters().duplicate, 1U);
  EXPECT_TRUE(paths.admit_answer(0, 17, board_t(), true, now));
  EXPECT_EQ(paths.counters().lost, 4U) << "the numbers of answers and states are one sequence";
  EXPECT_TRUE(paths.admit_answer(0, 3, board_t(), false, now));
  EXPECT_EQ(paths.counters().received, 4U) << "an answer to a host without control does not count";
}

TEST_F(OnePath, ALateBootHeartbeatIsNotARestart) {
  booting();
  heartbeat();
  pass(400);
  state();
  booting();
  pass(10);
  EXPECT_EQ(state(), Admission::yes) << "the clock shows no restart";
  EXPECT_EQ(link.restarts(), 0U) << "the first boot heard is not a restart";
}

TEST_F(OnePath, ARestartIsNoticedIfTheBoardCountsItsTimeFromZero) {
  board_offset = 0U - to_ms(now);
  heartbeat();
  pass(6000);
  heartbeat();
  booting();
  pass(1000);
  board_offset = 0U - to_ms(now);
  EXPECT_EQ(state(), Admission::restarted);
}

TEST_F(OnePath, ADelayOfSecondsIsNotARestart) {
  heartbeat();
  pass(9000);
  EXPECT_EQ(paths.admit(0, board_pnum++, board_t() - 9000, now), Admission::yes);
  pass(10);
  EXPECT_EQ(state(), Admission::yes);
  ask();
  EXPECT_EQ(answer(), Admission::yes) << "only the earlier datagrams were late";
}

TEST_F(OnePath, TheBoardsClockMayWrap) {
  board_offset = 0xffffffffU - to_ms(now) - 50;
  heartbeat();
  pass(100);
  EXPECT_EQ(state(), Admission::yes);
  EXPECT_TRUE(paths.is_newest(0, board_t(), now));
}

TEST_F(AnsweredPath, ADatagramOfAnEarlierBootIsDroppedAndAsksForAnAnswer) {
  pass(200);
  EXPECT_EQ(paths.admit(0, 5, board_t() - 3'600'000, now), Admission::no);
  EXPECT_EQ(paths.to_ask(now), 1);
  ask();
  EXPECT_EQ(answer(), Admission::yes) << "the board has not restarted";
  EXPECT_EQ(state(), Admission::yes);
}

TEST_F(AnsweredPath, AnAnswerProvesARestart) {
  pass(200);
  reboot();
  EXPECT_EQ(state(), Admission::no);
  ask();
  pass(5);
  EXPECT_EQ(answer(), Admission::restarted);
  EXPECT_EQ(state(), Admission::yes);
}

TEST_F(AnsweredPath, AnAnswerToAnotherProgramDoesNotProveARestart) {
  reboot();
  EXPECT_EQ(answer(), Admission::yes) << "an answer to another program is admitted";
  EXPECT_EQ(state(), Admission::no) << "the restart is not proved";
}

TEST_F(AnsweredPath, TenUnansweredQuestionsProveARestart) {
  reboot();
  int questions = 0;
  while (state() == Admission::no && questions < 100) {
    pass(100);
    if (paths.to_ask(now) == 0) continue;
    ask();
    ++questions;
  }
  EXPECT_EQ(questions, 10) << "firmware without answers may run after the restart";
}

TEST_F(AnsweredPath, QuestionsDuringAnOutageDoNotProveARestart) {
  for (int i = 0; i < 20; ++i) {  // time of the board's clock during an outage
    pass(100);
    ask();
  }
  EXPECT_EQ(paths.admit(0, 5, board_t() - 3'600'000, now), Admission::no)
      << "a replay must not be believed";
}

TEST_F(AnsweredPath, AnUnsentQuestionIsRepeatedAndNotCounted) {
  reboot();
  for (int i = 0; i < 20; ++i) {
    EXPECT_EQ(state(), Admission::no) << i;
    pass(100);
    ASSERT_EQ(paths.to_ask(now), 1) << i;
    paths.asked(0, ++question, false, now);
  }
}

TEST_F(AnsweredPath, AnUnsentQuestionOfTheProgramIsNotRepeated) {
  paths.asked(0, ++question, false, now);
  pass(1000);
  EXPECT_EQ(paths.to_ask(now), 0);
}

TEST_F(AnsweredPath, ANewBoardOnTheOnlyPathCountsAsARestart) {
  paths.on_transport(0, false, true, now);
  pass(5);
  paths.on_transport(0, true, true, now);
  ask();
  reboot();
  EXPECT_EQ(answer("another"), Admission::restarted);
  EXPECT_FALSE(paths.two_boards());
}

}  // namespace
}  // namespace r4
