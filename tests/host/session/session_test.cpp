// SPDX-License-Identifier: GPL-3.0-or-later
// The link: how it comes up, stays alive and ends, and how the session reports these changes.
#include "host/session/session.hpp"

#include <gtest/gtest.h>

#include "r4link/error.hpp"
#include "robot_on_paths.hpp"
#include "scripted_link.hpp"
#include "tests/support/datagrams.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;

using SessionLink = ConnectedSession;
using SessionFarewell = ConnectedSession;

TEST_F(NewSession, SendsAHeartbeatAtOnceAndThenTenASecond) {
  ASSERT_EQ(link.count('H'), 1U);
  EXPECT_EQ(link.sent[0].command, "H:ROS2-R4");
  EXPECT_EQ(link.sent[0].t, 0U) << "no heartbeat was heard to echo";
  EXPECT_NE(link.host_session, no_session);
  link.pass(10s);
  EXPECT_EQ(link.count('H'), 101U);
  EXPECT_EQ(link.sent.size(), 101U) << "only heartbeats may be sent";
  for (std::size_t i = 1; i < link.sent.size(); ++i) {
    EXPECT_EQ(link.sent[i].pnum, link.sent[i - 1].pnum + 1);
    EXPECT_EQ(link.sent[i].at - link.sent[i - 1].at, 100ms);
  }
}

TEST_F(SessionLink, IgnoresAnswersToAnotherHost) {
  link.pass(10ms);
  const Ticket question = link.session.send(Command::identify(), 1s, link.now);
  const Ticket command = link.session.send(Command::servo(1, Microseconds(1500)), 1s, link.now);
  const std::uint32_t ours = link.last('S').pnum;
  for (const std::uint32_t others : {ours + 1000, ours - 1000000, std::uint32_t{7}}) {
    link.nack(others, "BUSY");
  }
  const SessionId host = std::exchange(link.host_session, 0x1234);
  link.answer(link.last('Q').pnum, "udp");
  link.nack(ours, "BUSY");
  EXPECT_TRUE(link.results.empty());
  EXPECT_TRUE(link.nacks.empty());
  EXPECT_EQ(link.board_id, "");
  EXPECT_TRUE(link.session.in_control(link.now));
  link.host_session = host;
  link.answer(link.last('Q').pnum, "udp");
  link.nack(ours, "BUSY");
  EXPECT_EQ(outcome(question), Outcome::confirmed);
  EXPECT_EQ(outcome(command), Outcome::refused);
  EXPECT_TRUE(link.session.link().causes.has(LinkCause::busy));
}

TEST_F(SessionFarewell, EndsHeartbeatsAndRepeatsUntilTheBoardIsFree) {
  link.identity("udp+leave");
  const Ticket command = link.session.send(Command::servo(1, Microseconds(1500)), 1s, link.now);
  link.pass(5ms);
  link.sent.clear();
  const Ticket ticket = link.session.leave(100ms, link.now);
  ASSERT_NE(ticket, 0U);
  EXPECT_EQ(link.results.at(command).outcome, Outcome::closed);
  ASSERT_EQ(link.sent.size(), 1U);
  EXPECT_EQ(link.sent[0].command, "E:LEAVE");
  link.pass(45ms);
  ASSERT_EQ(link.sent.size(), 3U) << "the farewell must be repeated every 20 ms, alone";
  EXPECT_EQ(link.sent[2].bytes, link.sent[0].bytes);
  link.heartbeat(SafeReason::link);
  EXPECT_EQ(link.results.at(ticket).outcome, Outcome::confirmed);
  link.pass(2s);
  EXPECT_EQ(link.sent.size(), 3U) << "a heartbeat would take control again";
}

TEST_F(SessionFarewell, IsConfirmedByTheAnswerToARepetitionToo) {
  link.identity("leave");
  link.executed(1);
  const Ticket ticket = link.session.leave(100ms, link.now);
  link.heartbeat(SafeReason::link);  // in the millisecond of a state, so the order is unknown
  link.heartbeat(SafeReason::stop);  // more serious than the lost link
  EXPECT_EQ(link.results.count(ticket), 0U);
  link.nack(link.last('E').pnum, "DUPLICATE");
  EXPECT_EQ(link.results.at(ticket).outcome, Outcome::confirmed);
}

// The board had lost its host before it sent the heartbeat.
TEST_F(SessionFarewell, IsNotConfirmedByAnEarlierHeartbeat) {
  RobotOnPaths robot(RobotOnPaths::Cables{{40}});
  robot.connect();
  robot.run(1500);
  const std::string before = std::to_string(robot.board_ms(0) - 20);
  const Ticket ticket = robot.session->leave(RobotOnPaths::timeout, robot.now());
  robot.bring(0, with_crc("H:R4-ROS2;PNum:400;T:" + before + ";SAFE:1;"));
  EXPECT_EQ(robot.session->link().state, HostLinkState::safe)
      << "the heartbeat shows the safe state, but does not confirm";
  EXPECT_EQ(robot.results.count(ticket), 0U);
  EXPECT_EQ(robot.finish(ticket).outcome, Outcome::confirmed);
  EXPECT_FALSE(robot.board(0).link().has_owner());
}

TEST_F(NewSession, ConfirmsAFarewellEvenBeforeTheFirstState) {
  for (int i = 0; i < 3; ++i) link.reboot();
  ASSERT_GT(link.board_ms(), 1U << 31) << "T must not be newer than 0";
  link.heartbeat();
  link.identity("leave");
  const Ticket ticket = link.session.leave(100ms, link.now);
  ASSERT_NE(ticket, 0U);
  link.heartbeat(SafeReason::link);
  EXPECT_EQ(outcome(ticket), Outcome::confirmed);
}

TEST_F(SessionFarewell, ReportsThatItWasRefusedOrNotAnswered) {
  for (const bool answered : {false, true}) {
    ConnectedLink each;
    each.identity("leave");
    const Ticket ticket = each.session.leave(100ms, each.now);
    if (answered) each.nack(each.last('E').pnum, "BUSY");
    each.pass(100ms);
    EXPECT_EQ(each.results.at(ticket).outcome, answered ? Outcome::refused : Outcome::timed_out);
  }
}

TEST_F(SessionFarewell, IsSentOnlyToABoardThatMayObeyIt) {
  ConnectedLink older;
  older.identity("udp+leaves");
  EXPECT_EQ(older.session.leave(100ms, older.now), 0U);
  older.pass(1s);
  EXPECT_EQ(older.count('E'), 0U);

  ConnectedLink silent;
  silent.identity("leave");
  silent.pass(1500ms);
  EXPECT_EQ(silent.session.leave(100ms, silent.now), 0U);

  ConnectedLink rebooted;
  rebooted.identity("leave");
  rebooted.reboot();
  rebooted.heartbeat();
  EXPECT_EQ(rebooted.session.leave(100ms, rebooted.now), 0U)
      << "the firmware may be another after the restart";

  EXPECT_NE(link.session.leave(100ms, link.now), 0U) << "the board confirms commands";
  EXPECT_EQ(link.last('E').command, "E:LEAVE");

  ScriptedLink of_the_paper;
  of_the_paper.heartbeat();
  of_the_paper.pass(10ms);
  of_the_paper.state("AIN24:24.10;");
  EXPECT_EQ(of_the_paper.session.leave(100ms, of_the_paper.now), 0U);
}

// T wraps after 49 days. Two values cannot be compared after half of that time.
TEST_F(SessionLink, HearsABoardAgainAfterAMonthOfSilence) {
  for (int day = 0; day < 30; ++day) {
    link.now += 24h;
    link.session.poll(link.now);
  }
  EXPECT_EQ(link.restarts, 1) << "the board may have restarted";
  EXPECT_EQ(link.session.disarmed_by(), DisarmCause::restart) << "this computer has not slept";
  EXPECT_EQ(link.session.link().state, HostLinkState::lost);
  link.heartbeat();
  EXPECT_EQ(link.session.link().state, HostLinkState::active);
  EXPECT_EQ(link.restarts, 1) << "the new T must not count as a second restart";
}

TEST_F(NewSession, SelectsItsFieldsWhenTheLinkBeginsAndWhenTheyAreMissing) {
  link.heartbeat();
  link.pass(1ms);
  ASSERT_EQ(link.count('F'), 1U);
  EXPECT_EQ(link.last('F').command, "F:DEFAULT,SAFE,CMD");
  link.pass(250ms);
  link.state("AIN24:24.28;");  // without CMD: the F was lost
  EXPECT_EQ(link.count('F'), 2U);
  EXPECT_GT(link.last('F').pnum, link.all('F')[0].pnum) << "each repetition must have a new number";
  link.executed(link.last('F').pnum);
  for (int i = 0; i < 20; ++i) {
    link.pass(100ms);
    link.executed(link.all('F')[1].pnum);
  }
  EXPECT_EQ(link.count('F'), 2U) << "F must not be repeated when the board obeys";
  for (int i = 0; i < 4; ++i) {  // another host has selected other fields
    link.pass(100ms);
    link.state("ENC1:5;");
  }
  EXPECT_EQ(link.count('F'), 4U) << "every 200 ms";
}

TEST_F(SessionLink, AddsItsOwnFieldsToTheFieldsOfTheUser) {
  link.session.send(Command::fields("ENC1,ENC2"), 1s, link.now);
  EXPECT_EQ(link.last('F').command, "F:ENC1,ENC2,SAFE,CMD");
  link.executed(link.last('F').pnum);
  link.session.send(Command::fields("CMD,ENC1,SAFE"), 1s, link.now);
  EXPECT_EQ(link.last('F').command, "F:CMD,ENC1,SAFE") << "the user's fields already contain all";
  link.executed(link.last('F').pnum);
  link.pass(2s);  // the link is lost, and the board has reset its fields
  link.boot_heartbeat();
  link.heartbeat();
  link.pass(10ms);
  EXPECT_EQ(link.last('F').command, "F:CMD,ENC1,SAFE");
}

TEST(SessionFields, AreNotSelectedOnRequest) {
  SessionOptions options = ScriptedLink::without_questions();
  options.fields = "";
  ScriptedLink link(options);
  link.heartbeat();
  link.send_states(50, "AIN24:24.28;");
  EXPECT_EQ(link.count('F'), 0U);
  link.session.send(Command::fields("ENC1"), 1s, link.now);
  EXPECT_EQ(link.last('F').command, "F:ENC1");
}

TEST(SessionFields, MustExist) {
  SessionOptions options;
  options.fields = "AIN24,AIN25";
  EXPECT_THROW(ScriptedLink{options}, Error);
}

TEST_F(SessionLink, CountsDamagedDatagramsAndGoesOn) {
  std::string damaged = captured_state();
  damaged[6] ^= 1;
  link.raw(damaged);
  link.raw("");
  link.raw("noise");
  link.raw(with_crc("AIN24:much;PNum:5900;T:5;"));
  EXPECT_EQ(link.bad, (std::vector<ReadError>{ReadError::crc, ReadError::length, ReadError::syntax,
                                              ReadError::syntax}));
  EXPECT_EQ(link.session.statistics(link.now).damaged, 4U);
  EXPECT_EQ(link.session.link().state, HostLinkState::active);
}

TEST_F(NewSession, IgnoresDatagramsThatAreNotFromABoard) {
  const auto before = link.sent.size();
  link.raw(with_crc("H:ROS2-R4;PNum:66;T:5;"));
  link.raw(with_crc("O:358,1,1;PNum:67;T:5;"));
  EXPECT_EQ(link.sent.size(), before);
  EXPECT_EQ(link.session.link().state, HostLinkState::connecting);
  EXPECT_EQ(link.session.statistics(link.now).received, 0U);
}

// The board answers each question after `delay`. Returns the number of questions in the last five
// of twenty seconds.
std::size_t questions_of(ScriptedLink& link, Time delay, bool answers, bool names_question) {
  if (!link.session.in_control(link.now)) link.connect();
  std::size_t asked = 0, before = 0;
  for (int ms = 0; ms < 20'000; ++ms) {
    if (ms == 15'000) before = link.count('Q');
    link.pass(1ms);
    if (ms % 10 == 0) link.executed(1);
    if (answers && link.count('Q') > asked && link.last('Q').at + delay <= link.now) {
      asked = link.count('Q');
      link.identity("udp", names_question);
    }
  }
  return link.count('Q') - before;
}

TEST(SessionQuestions, AreSentOnceASecondAndMoreOftenWhileTheClockErrorIsLarge) {
  ScriptedLink fast{SessionOptions{}}, slow{SessionOptions{}}, silent{SessionOptions{}},
      old{SessionOptions{}};
  EXPECT_NEAR(static_cast<double>(questions_of(fast, 0ms, true, true)), 5, 1);
  EXPECT_EQ(fast.board_id, "board-7");
  EXPECT_NEAR(fast.session.statistics(fast.now).round_trip_us, 1000, 1000);
  EXPECT_NEAR(static_cast<double>(questions_of(slow, 8ms, true, true)), 49, 2);
  EXPECT_NEAR(static_cast<double>(questions_of(silent, 0ms, false, false)), 5, 1);
  EXPECT_NEAR(static_cast<double>(questions_of(old, 3ms, true, false)), 5, 1);
  EXPECT_EQ(silent.session.state().sampled_error, ReceivedState::unknown);
  EXPECT_EQ(old.session.state().sampled_error, ReceivedState::unknown)
      << "the answer does not name its question";
  EXPECT_GT(old.session.statistics(old.now).round_trip_us, 2000);
}

TEST(SessionQuestions, ShowWhenAStateWasSampled) {
  ScriptedLink link{SessionOptions{}};
  link.connect();
  EXPECT_LE(link.session.state().sampled, link.session.state().received);
  EXPECT_EQ(link.session.state().sampled_error, ReceivedState::unknown);
  questions_of(link, 1ms, true, true);
  const ReceivedState& state = link.session.state();
  EXPECT_LE(state.sampled_error, 1300us);
  EXPECT_LE(std::chrono::abs(state.received - state.sampled), state.sampled_error);
  EXPECT_LE(std::chrono::abs(state.sampled_at_wall_time() - std::chrono::system_clock::now() -
                             (state.sampled - ReceivedState::Clock::now())),
            1s);
  const Statistics statistics = link.session.statistics(link.now);
  EXPECT_NEAR(statistics.clock_drift_ppm, 0, statistics.clock_drift_error_ppm);
  EXPECT_GT(statistics.clock_drift_error_ppm, 0);
}

}  // namespace
}  // namespace r4::test
