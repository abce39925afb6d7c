// SPDX-License-Identifier: GPL-3.0-or-later
// What is said of a link on which datagrams do not pass.
#include <gtest/gtest.h>

#include <string>

#include "r4link/link.hpp"

namespace r4 {
namespace {

std::string reason_of_link(const LinkStatus& link) { return explain("can://can0", link).reason; }

CommandResult timed_out_command() {
  CommandResult result;
  result.outcome = Outcome::timed_out;
  result.elapsed = std::chrono::seconds{2};
  return result;
}

TEST(Explain, NamesAnotherProtocolInsteadOfAnotherHost) {
  const LinkStatus link{.busy = true, .trouble = TransportTrouble::foreign_frames};
  EXPECT_EQ(reason_of_link(link).substr(0, 36), "frames that make no R4 datagram come");
  const Problem problem = explain("R:1,On", timed_out_command(), link);
  EXPECT_NE(problem.reason.find("another protocol, such as CANopen"), std::string::npos);
  EXPECT_NE(problem.fix.find("r4 bus"), std::string::npos);
}

TEST(Explain, SaysThatFlowControlIsLateWhileTheBoardIsHeard) {
  for (const HostLinkState state : {HostLinkState::active, HostLinkState::safe}) {
    const LinkStatus link{
        .state = state, .reason = SafeReason::link, .trouble = TransportTrouble::late_frames};
    EXPECT_NE(reason_of_link(link).find("does not come within 20 ms"), std::string::npos);
    const Problem problem = explain("R:1,On", timed_out_command(), link);
    EXPECT_NE(problem.reason.find("does not come within 20 ms"), std::string::npos);
  }
  const LinkStatus lost{.state = HostLinkState::lost, .trouble = TransportTrouble::late_frames};
  EXPECT_EQ(reason_of_link(lost), "the board has fallen silent");
}

TEST(Explain, BlamesNoFramesForAStopWhichIsAFrameOfItsOwn) {
  const LinkStatus link{.state = HostLinkState::safe,
                        .reason = SafeReason::handle,
                        .trouble = TransportTrouble::late_frames};
  const Problem problem = explain("E:STOP", timed_out_command(), link);
  EXPECT_EQ(problem.reason.find("20 ms"), std::string::npos) << problem.reason;
}

}  // namespace
}  // namespace r4
