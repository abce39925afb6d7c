// SPDX-License-Identifier: GPL-3.0-or-later
// The causes of a link's status: their set, their order, and their words.
#include <gtest/gtest.h>

#include <set>
#include <string>
#include <vector>

#include "r4link/link.hpp"

namespace r4 {
namespace {

// All causes in the order of the enumeration. to_text() has no text after the last cause.
std::vector<LinkCause> all_causes() {
  std::vector<LinkCause> all;
  for (unsigned i = 0; *to_text(static_cast<LinkCause>(i)) != '\0'; ++i) {
    all.push_back(static_cast<LinkCause>(i));
  }
  return all;
}

LinkStatus well_but_for(LinkCauses causes) {
  return {.state = HostLinkState::active, .causes = causes, .in_control = true};
}

std::string reason_of_link(const LinkStatus& link) { return explain("can://can0", link).reason; }

CommandResult timed_out_command() {
  CommandResult result;
  result.outcome = Outcome::timed_out;
  result.elapsed = std::chrono::seconds{2};
  return result;
}

TEST(LinkCauses, AreReadMostSevereFirst) {
  constexpr LinkCauses some{LinkCause::busy, LinkCause::transport_down, LinkCause::other_board};
  static_assert(some.first() == LinkCause::transport_down);
  static_assert(some.has(LinkCause::busy) && !some.has(LinkCause::watchdog));
  static_assert(some.without({LinkCause::busy, LinkCause::transport_down}).first() ==
                LinkCause::other_board);
  static_assert(some.without(some) == LinkCauses() && LinkCauses().empty());
  static_assert(!LinkCauses().first() && !some.has_any({}));
  std::vector<LinkCause> read;
  for (const LinkCause cause : some) read.push_back(cause);
  EXPECT_EQ(read, (std::vector<LinkCause>{LinkCause::transport_down, LinkCause::busy,
                                          LinkCause::other_board}));
}

TEST(Explain, AWiringWithATroubleHasItsOwnFix) {
  std::set<std::string> fixes;
  for (const ChipTrouble trouble :
       {ChipTrouble::not_confirmed, ChipTrouble::damaged, ChipTrouble::other_bus}) {
    LinkStatus link = well_but_for({});
    link.state = HostLinkState::safe;
    link.reason = SafeReason::fault;
    link.chip = {0, trouble};
    const Problem problem = explain("serial:auto", link);
    EXPECT_NE(problem.reason.find("wir"), std::string::npos) << problem.reason;
    EXPECT_NE(problem.fix.find("r4 wiring "), std::string::npos) << problem.fix;
    fixes.insert(problem.fix);
    CommandResult result;
    result.outcome = Outcome::not_armed;
    result.disarmed = DisarmCause::earlier_fault;
    const Problem not_armed = explain("arm()", result, link);
    EXPECT_EQ(not_armed.reason, "not armed: " + problem.reason);
    EXPECT_EQ(not_armed.fix, problem.fix);
  }
  EXPECT_EQ(fixes.size(), 3U);
}

TEST(Explain, HasAnOwnReasonForEachCause) {
  ASSERT_EQ(all_causes().size(), 13U);
  EXPECT_EQ(all_causes().back(), LinkCause::other_board);
  std::set<std::string> texts, reasons;
  for (const LinkCause cause : all_causes()) {
    const Problem problem = explain(cause);
    EXPECT_EQ(problem.thing, to_text(cause));
    EXPECT_FALSE(problem.fix.empty()) << problem.thing;
    EXPECT_EQ(reason_of_link(well_but_for({cause})), problem.reason);
    EXPECT_EQ(explain("board", well_but_for({cause})).fix, problem.fix);
    texts.insert(problem.thing);
    reasons.insert(problem.reason);
  }
  EXPECT_EQ(texts.size(), all_causes().size());
  EXPECT_EQ(reasons.size(), all_causes().size());
  EXPECT_EQ(reasons.count(reason_of_link(well_but_for({}))), 0U);
}

TEST(Explain, NamesTheMoreSevereOfTwoCauses) {
  const std::vector<LinkCause> all = all_causes();
  for (std::size_t i = 0; i < all.size(); ++i) {
    for (std::size_t j = i + 1; j < all.size(); ++j) {
      EXPECT_EQ(reason_of_link(well_but_for({all[j], all[i]})), explain(all[i]).reason)
          << to_text(all[i]) << ", " << to_text(all[j]);
    }
  }
}

TEST(Explain, NamesAPathToAnotherBoardOnlyWithoutOtherCauses) {
  LinkStatus link{.state = HostLinkState::safe,
                  .reason = SafeReason::stop,
                  .causes = {LinkCause::other_board},
                  .in_control = true};
  EXPECT_EQ(reason_of_link(link), "the board is safe: an emergency stop is latched");
  link = well_but_for({LinkCause::other_board});
  link.in_control = false;
  EXPECT_NE(reason_of_link(link).find("has not confirmed a command"), std::string::npos);
}

TEST(Explain, NamesAnotherProtocolInsteadOfAnotherHost) {
  const LinkStatus link{.causes = {LinkCause::busy, LinkCause::foreign_frames}};
  EXPECT_NE(reason_of_link(link).find("carries frames that are not R4 datagrams"),
            std::string::npos);
  const Problem problem = explain(Command::relay(1, true), timed_out_command(), link);
  EXPECT_NE(problem.reason.find("another protocol, such as CANopen"), std::string::npos);
  EXPECT_NE(problem.fix.find("r4 bus"), std::string::npos);
}

TEST(Explain, SaysThatFlowControlIsLate) {
  for (const HostLinkState state : {HostLinkState::active, HostLinkState::safe}) {
    const LinkStatus link{
        .state = state, .reason = SafeReason::link, .causes = {LinkCause::late_frames}};
    EXPECT_NE(reason_of_link(link).find("does not come within 20 ms"), std::string::npos);
    const Problem problem = explain(Command::relay(1, true), timed_out_command(), link);
    EXPECT_NE(problem.reason.find("does not come within 20 ms"), std::string::npos);
  }
}

TEST(Explain, DoesNotBlameLateFramesForAnUnconfirmedStop) {
  const LinkStatus link{.state = HostLinkState::safe,
                        .reason = SafeReason::handle,
                        .causes = {LinkCause::late_frames}};
  const Problem problem = explain(Command::stop(), timed_out_command(), link);
  EXPECT_EQ(problem.reason.find("20 ms"), std::string::npos) << problem.reason;
}

// A stop needs no lease.
TEST(Explain, DoesNotBlameAFullBoardForAnUnconfirmedStop) {
  for (const LinkCause cause : {LinkCause::watchers_full, LinkCause::not_watchable}) {
    const LinkStatus link{.state = HostLinkState::lost, .causes = {cause}};
    const Problem problem = explain(Command::stop(), timed_out_command(), link);
    EXPECT_NE(problem.reason.find("the board is silent"), std::string::npos) << problem.reason;
  }
}

TEST(Explain, NamesACommandWithoutItsSecret) {
  const CommandResult refused{Outcome::refused, Refusal::auth, Time{0}};
  EXPECT_EQ(explain(Command::setting("password", "eeeeeeee"), refused, {}).thing, "C:password,...");
}

TEST(Explain, ARefusedChannelOfAUartIsAUartThatIsOff) {
  const CommandResult refused{Outcome::refused, Refusal::channel, Time{0}};
  const Problem problem = explain(Command::uart_write(2, "A"), refused, {});
  EXPECT_EQ(problem.reason, "refused by the board: CHANNEL (the UART is off)");
  EXPECT_EQ(problem.fix, "switch it on, such as C:uart2,115200:8N1");
}

TEST(Explain, ALinkToTwoBoardsIsNotReportedAsARefusal) {
  const CommandResult refused{Outcome::refused, Refusal::none, Time{0}};
  const LinkStatus link{.causes = {LinkCause::two_boards}};
  const Problem problem = explain("async_wait_active()", refused, link);
  EXPECT_EQ(problem.reason, explain("board", link).reason);
  EXPECT_NE(problem.fix, "");
}

TEST(Explain, ReportsThatAStopBeyondTheLimitWasSentOnce) {
  const CommandResult full{Outcome::full, Refusal::none, Time{0}};
  const Problem problem = explain(Command::stop(), full, {});
  EXPECT_NE(problem.reason.find("sent once"), std::string::npos) << problem.reason;
  EXPECT_TRUE(problem.fix.starts_with(stop_last_resort)) << problem.fix;
}

TEST(Explain, DoesNotConfuseTheNameOfACallWithACommand) {
  const CommandResult refused{Outcome::refused, Refusal::range, Time{0}};
  EXPECT_EQ(explain("arm()", refused, {}).thing, "arm()");
  EXPECT_NE(explain("arm()", refused, {}).fix, "");
  EXPECT_EQ(explain("E:STOP", timed_out_command(), {}).reason.find("the stop"), std::string::npos);
}

}  // namespace
}  // namespace r4
