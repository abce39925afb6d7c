// SPDX-License-Identifier: GPL-3.0-or-later
// The findings about a link from which states were received for a while.
#include "tools/r4/doctor/link_check.hpp"

#include <gtest/gtest.h>

#include <string>

namespace r4::tool {
namespace {

LinkSample well() {
  LinkSample sample;
  sample.seconds = 5;
  sample.received = 510;
  sample.states = 500;
  sample.answered = Answered::yes;
  sample.answer_us = 600;
  sample.link = {ErrorKind::refused, "can://can0?node=5", "the link's reason", "the link's fix"};
  return sample;
}

// The findings, as "severity check: reason".
std::string verdict(const LinkSample& sample) {
  std::string all;
  for (const Finding& each : judge_link("can://can0?node=5", sample)) {
    all += std::string(to_text(each.severity)) + " " + each.check + ": " + each.reason + "\n";
  }
  return all;
}

TEST(DoctorLink, IsOkWithStatesAndAnAnswerInTime) {
  EXPECT_EQ(
      verdict(well()),
      "ok link: 500 states in 5.0 s, 0 lost, 0 damaged, jitter 0.0 ms; the board answers in 0.6 "
      "ms\n");
}

TEST(DoctorLink, JudgesLossDamageAndJitter) {
  const auto judged = [](std::uint64_t lost, std::uint64_t damaged, double jitter_us) {
    LinkSample sample = well();
    sample.received -= lost;
    sample.lost = lost;
    sample.damaged = damaged;
    sample.jitter_us = jitter_us;
    return judge_link("udp://r4", sample).front();
  };
  EXPECT_EQ(judged(1, 0, 300).severity, Severity::ok);
  EXPECT_EQ(judged(10, 0, 300).severity, Severity::warning);
  EXPECT_EQ(judged(100, 0, 300).severity, Severity::error);
  EXPECT_EQ(judged(0, 2, 300).check, "link.damaged");
  EXPECT_EQ(judged(0, 0, 20000).check, "link.jitter");
}

TEST(DoctorLink, IsAnErrorWithoutAnyState) {
  LinkSample sample = well();
  sample.states = 0;
  EXPECT_EQ(verdict(sample),
            "error link.states: 510 datagrams arrived in 5.0 s, but no state: the link's reason\n");
}

TEST(DoctorLink, IsAnErrorIfTheBoardDoesNotAnswer) {
  LinkSample sample = well();
  sample.answered = Answered::no;
  sample.answer_us = 0;
  EXPECT_EQ(verdict(sample),
            "error link.answer: the board does not answer: it does not receive datagrams from this "
            "computer\n");
  sample.trouble = TransportTrouble::foreign_frames;
  EXPECT_EQ(verdict(sample), "error link.answer: the link's reason\n");
}

TEST(DoctorLink, IsAWarningIfTheBoardAnswersTooLate) {
  LinkSample sample = well();
  sample.answer_us = 251000;
  EXPECT_EQ(verdict(sample),
            "warning link.answer: the board answers after 251 ms: commands take effect late, and a "
            "board with a key refuses them\n");
}

TEST(DoctorLink, IsANoteIfTheBoardWasNotAsked) {
  LinkSample sample = well();
  sample.answered = Answered::not_asked;
  sample.answer_us = 0;
  EXPECT_EQ(verdict(sample),
            "note link: 500 states in 5.0 s, 0 lost, 0 damaged, jitter 0.0 ms; the board was not "
            "asked for an answer\n");
}

}  // namespace
}  // namespace r4::tool
