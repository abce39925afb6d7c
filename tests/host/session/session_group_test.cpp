// SPDX-License-Identifier: GPL-3.0-or-later
// Groups of commands. If the board executes groups, a group is one datagram. Otherwise a group is
// one command after another.
#include <gtest/gtest.h>

#include "r4link/commands/command_text.hpp"
#include "r4link/setpoints.hpp"
#include "scripted_link.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;

const Setpoints two_motors = Setpoints{Command::osmc(1, Pwm(358), Direction::forward),
                                       Command::osmc(2, Pwm(359), Direction::forward),
                                       Command::servo(3, Microseconds(1500))};

struct SessionGroup : NewSession {
  // Connects to a board that has reported whether it executes groups.
  void connect(std::string_view capabilities) {
    link.connect();
    link.identity(capabilities);
  }
  Ticket send(Time timeout = 1s) { return link.session.send(two_motors, timeout, link.now); }
  PostResult post() { return link.session.post(two_motors, link.now); }
  static std::string fields(const ScriptedLink::Sent& sent) {
    return sent.bytes.substr(0, sent.bytes.find("SID:"));
  }
  // The board refuses one command of a group and names it.
  void nack_at(std::uint32_t pnum, const std::string& code, int at) {
    link.state("N:" + std::to_string(pnum) + "," + code + ";AT:" + std::to_string(at) +
               ";SESSION:" + std::to_string(link.session_pnum) + ";" + link.asker());
  }
};

TEST_F(SessionGroup, IsOneDatagramAndOneCommand) {
  connect("udp+group");
  const Ticket ticket = send();
  ASSERT_EQ(link.sent.size(), 1U);
  EXPECT_EQ(fields(link.sent[0]), "O:358,1,1;O:359,1,2;S:1500,3;");
  link.pass(60ms);
  ASSERT_EQ(link.all('O').size(), 2U);
  EXPECT_EQ(link.all('O')[1].bytes, link.sent[0].bytes) << "a repetition must have the same bytes";
  link.executed(link.last('O').pnum);
  EXPECT_EQ(result(ticket).outcome, Outcome::confirmed);
  EXPECT_EQ(result(ticket).at, 0);
  EXPECT_EQ(link.session.statistics(link.now).commands, 1U);
  EXPECT_EQ(link.session.statistics(link.now).confirmed, 1U);
}

TEST_F(SessionGroup, ARefusalNamesTheBadCommandAndExecutesNone) {
  connect("group");
  const Ticket ticket = send();
  nack_at(link.last('O').pnum, "CHANNEL", 2);
  EXPECT_EQ(result(ticket).outcome, Outcome::refused);
  EXPECT_EQ(result(ticket).at, 2);
  EXPECT_EQ(result(ticket).executed, 0);
  const Problem problem = explain(two_motors, result(ticket), link.session.link());
  EXPECT_EQ(problem.thing, "O:359,1,2");
  EXPECT_EQ(problem.at, 2);
  EXPECT_TRUE(contains(problem.reason, "CHANNEL"));
  EXPECT_TRUE(contains(problem.reason, "none of the 3 commands was executed"));
  EXPECT_TRUE(contains(problem.fix, "O:pwm,dir,ch"));

  const Ticket other = send();
  link.nack(link.last('O').pnum, "SAFE");
  EXPECT_EQ(result(other).at, 0);
  EXPECT_EQ(explain(two_motors, result(other), link.session.link()).thing, to_text(two_motors));

  const Ticket wrong = send();
  nack_at(link.last('O').pnum, "RANGE", 4);
  EXPECT_EQ(result(wrong).at, 0) << "the group has no fourth command";
}

TEST_F(SessionGroup, AsksFirstWhetherTheBoardExecutesGroups) {
  link.connect();
  send();
  EXPECT_EQ(link.count('O'), 0U);
  EXPECT_EQ(link.count('Q'), 1U);
  link.session.send(Command::servo(1, Microseconds(1)), 1s, link.now);
  EXPECT_EQ(link.session.post(Command::servo(1, Microseconds(0)), link.now), PostResult::queue_full)
      << "the post would overtake the waiting commands";
  EXPECT_EQ(post(), PostResult::queue_full);
  link.pass(250ms);
  EXPECT_EQ(link.count('Q'), 3U) << "the first questions may have been lost";
  link.pass(650ms);
  const std::size_t asked = link.count('Q');
  EXPECT_GE(asked, 9U);
  EXPECT_EQ(link.count('O'), 0U) << "a group must not be split while answers are lost";
  EXPECT_EQ(link.count('S'), 0U) << "the order of commands must be kept";
  link.identity("group");
  ASSERT_EQ(link.count('O'), 1U);
  EXPECT_EQ(fields(link.last('O')), "O:358,1,1;O:359,1,2;S:1500,3;");
  ASSERT_EQ(link.count('S'), 1U);
  EXPECT_LT(link.last('O').pnum, link.last('S').pnum);
  link.pass(1s);
  EXPECT_EQ(link.count('Q'), asked);
}

TEST_F(SessionGroup, IsSentOneByOneToABoardWithoutGroups) {
  connect("udp");
  const Ticket ticket = send();
  EXPECT_EQ(fields(link.sent.back()), "O:358,1,1;");
  const Ticket behind = link.session.send(Command::servo(7, Microseconds(7)), 1s, link.now);
  link.pass(60ms);
  EXPECT_EQ(link.sent.size(), 2U) << "the first command was sent twice";
  link.executed(link.last('O').pnum);
  EXPECT_EQ(fields(link.sent.back()), "O:359,1,2;");
  EXPECT_TRUE(under_way(ticket));
  EXPECT_EQ(link.session.post(Command::osmc(1, Pwm(0), Direction::forward), link.now),
            PostResult::queue_full)
      << "the remaining commands would come after the post";
  link.executed(link.last('O').pnum);
  EXPECT_EQ(link.count('S'), 2U) << "later commands need not wait after the last command was sent";
  link.executed(link.all('S')[0].pnum);
  link.executed(link.all('S')[1].pnum);
  EXPECT_EQ(result(ticket).outcome, Outcome::confirmed);
  EXPECT_EQ(result(behind).outcome, Outcome::confirmed);
}

TEST_F(SessionGroup, EndsAtTheFirstFailureOnABoardWithoutGroups) {
  connect("udp");
  const Ticket ticket = send();
  link.executed(link.last('O').pnum);
  link.nack(link.last('O').pnum, "SAFE");
  EXPECT_EQ(result(ticket).outcome, Outcome::refused);
  EXPECT_EQ(result(ticket).at, 2);
  EXPECT_EQ(result(ticket).executed, 1);
  EXPECT_EQ(link.count('S'), 0U);
  const Problem problem = explain(two_motors, result(ticket), link.session.link());
  EXPECT_EQ(problem.thing, "O:359,1,2");
  EXPECT_TRUE(contains(problem.reason, "command 2 of 3, and the commands before it were executed"));

  const Ticket late = send(100ms);
  link.pass(100ms);
  EXPECT_EQ(result(late).outcome, Outcome::timed_out);
  EXPECT_EQ(result(late).at, 1);
  EXPECT_EQ(result(late).executed, 0);
}

TEST_F(SessionGroup, IsSentOneByOneToABoardThatAnswersNothing) {
  link.heartbeat();
  send(20s);
  link.send_states(300, "AIN24:24.28;OSMC1:0,0;");  // the paper's board has neither F nor Q
  ASSERT_GE(link.count('O'), 1U);
  EXPECT_EQ(fields(link.last('O')), "O:358,1,1;");
  EXPECT_EQ(link.count('Q'), 5U);
  link.state("AIN24:24.28;OSMC1:358,1;");
  EXPECT_EQ(fields(link.last('O')), "O:359,1,2;")
      << "the command before it was confirmed by its value";
}

TEST_F(SessionGroup, AsksAgainAfterARestartOfTheBoard) {
  connect("group");
  link.reboot();
  link.boot_heartbeat();
  link.pass(300ms);
  link.sent.clear();
  link.connect();
  send();
  EXPECT_EQ(link.count('O'), 0U);
  EXPECT_EQ(link.count('Q'), 1U);
}

TEST_F(SessionGroup, IsPostedOnceAndItsRefusalIsReported) {
  connect("group");
  ASSERT_TRUE(post());
  EXPECT_EQ(fields(link.sent.back()), "O:358,1,1;O:359,1,2;S:1500,3;");
  link.pass(150ms);
  EXPECT_EQ(link.count('O'), 1U);
  nack_at(link.last('O').pnum, "RANGE", 3);
  ASSERT_EQ(link.refused.size(), 1U);
  EXPECT_EQ(to_text(link.refused[0].command), "S:1500,3");
  EXPECT_EQ(link.refused[0].at, 3);
  EXPECT_EQ(link.refused[0].group, 3);
  ASSERT_TRUE(post());
  link.nack(link.last('O').pnum, "SAFE");
  ASSERT_EQ(link.refused.size(), 2U);
  EXPECT_EQ(to_text(link.refused[1].command), "O:358,1,1");
  EXPECT_EQ(link.refused[1].at, 0);
}

TEST_F(SessionGroup, SendsOneCommandAloneAndRefusesAnEmptyGroup) {
  link.connect();
  link.session.send(Setpoints{Command::osmc(1, Pwm(358), Direction::forward)}, 1s, link.now);
  EXPECT_EQ(fields(link.sent.back()), "O:358,1,1;")
      << "a group of one command must be sent as a command";
  EXPECT_TRUE(link.session.post(Setpoints{Command::servo(1, Microseconds(5))}, link.now));
  EXPECT_THROW(link.session.send(Setpoints{}, 1s, link.now), Error);
  EXPECT_THROW(link.session.post(Setpoints{}, link.now), Error);
}

TEST_F(SessionGroup, IsNeverPostedAsOneDatagramToABoardWithoutGroups) {
  link.heartbeat();  // from a board that answers no question
  PostResult last = post();
  for (int i = 0; i < 100 && !last; ++i) {
    EXPECT_EQ(link.count('O'), 0U);
    link.pass(100ms);
    link.state("AIN24:24.28;");
    last = post();
  }
  EXPECT_EQ(last, PostResult::sent);
  ASSERT_EQ(link.count('O'), 2U) << "the commands must be sent one after the other";
  EXPECT_EQ(fields(link.all('O')[0]), "O:358,1,1;");
  EXPECT_EQ(fields(link.all('O')[1]), "O:359,1,2;");
  EXPECT_EQ(fields(link.last('S')), "S:1500,3;");
}

}  // namespace
}  // namespace r4::test
