// SPDX-License-Identifier: GPL-3.0-or-later
#include "host/measurement/identity_question.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>

namespace r4::test {
namespace {

using namespace std::chrono_literals;

Identity answer_to(std::uint32_t pnum) {
  Identity identity;
  identity.has_asked = true;
  identity.asked = pnum;
  return identity;
}

TEST(IdentityQuestion, MatchesTheAnswerThatNamesIt) {
  IdentityQuestion question;
  question.asked(7, 100ms);
  question.asked(8, 200ms);
  EXPECT_FALSE(question.answered(answer_to(9)));
  EXPECT_EQ(question.answered(answer_to(7)), 100ms);
  EXPECT_FALSE(question.answered(answer_to(7))) << "a second answer must not count";
  EXPECT_EQ(question.answered(answer_to(8)), 200ms);
}

TEST(IdentityQuestion, ARepeatedQuestionIsTimedFromItsFirstSending) {
  IdentityQuestion question;
  question.asked(7, 100ms);
  question.asked(7, 200ms);
  EXPECT_EQ(question.answered(answer_to(7)), 100ms)
      << "the answer may have been under way for so long";
  EXPECT_FALSE(question.answered(answer_to(7)));
}

TEST(IdentityQuestion, IsForgottenAfterEightNewerOnes) {
  IdentityQuestion question;
  for (std::uint32_t pnum = 0; pnum <= 8; ++pnum) question.asked(pnum, 100ms);
  EXPECT_FALSE(question.answered(answer_to(0)));
  EXPECT_EQ(question.answered(answer_to(1)), 100ms);
}

TEST(IdentityQuestion, AnAnswerWithoutANumberMatchesTheNewestQuestion) {
  IdentityQuestion question;
  question.asked(7, 100ms);
  question.asked(8, 200ms);
  EXPECT_EQ(question.answered(Identity{}), 200ms);
  EXPECT_FALSE(question.answered(Identity{}));
}

}  // namespace
}  // namespace r4::test
