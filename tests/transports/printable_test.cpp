// SPDX-License-Identifier: GPL-3.0-or-later
// Text of other programs as one line that is safe in a terminal and a log.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <string>

#include "r4link/error.hpp"

namespace r4::test {
namespace {

TEST(Printable, LeavesTextAsItIs) {
  for (const char* text : {"", "left-arm", "C:\\drive, 50 %", "Gerät – 電機 ÿ", "🤖", "\uFFFD"}) {
    EXPECT_EQ(printable(text), text);
  }
}

TEST(Printable, WritesControlCharactersAsBytes) {
  EXPECT_EQ(printable("a\x1b]0;owned\x07"), "a\\x1b]0;owned\\x07");
  EXPECT_EQ(printable("one\r\n\ttwo\x7f"), "one\\x0d\\x0a\\x09two\\x7f");
  EXPECT_EQ(printable(std::string_view("a\0b", 3)), "a\\x00b");
  EXPECT_EQ(printable("\u009b2J"), "\\xc2\\x9b2J");  // ESC [ as one character
}

TEST(Printable, WritesCharactersThatReorderOrHideTextAsBytes) {
  EXPECT_EQ(printable("exe.\u202Egnp"), "exe.\\xe2\\x80\\xaegnp");
  EXPECT_EQ(printable("a\u200Bb"), "a\\xe2\\x80\\x8bb");
  EXPECT_EQ(printable("\uFEFFa"), "\\xef\\xbb\\xbfa");
  EXPECT_EQ(printable("a\u2028b"), "a\\xe2\\x80\\xa8b");
  EXPECT_EQ(printable("\u2066x\u2069"), "\\xe2\\x81\\xa6x\\xe2\\x81\\xa9");
  EXPECT_EQ(printable("\U000E0041"), "\\xf3\\xa0\\x81\\x81");
}

TEST(Printable, WritesInvalidUtf8AsBytes) {
  EXPECT_EQ(printable("\xff\xfe"), "\\xff\\xfe");
  EXPECT_EQ(printable("a\xc3"), "a\\xc3");         // cut
  EXPECT_EQ(printable("\x80"), "\\x80");           // a continuation byte without a first byte
  EXPECT_EQ(printable("\xc0\x9b"), "\\xc0\\x9b");  // longer than necessary
  EXPECT_EQ(printable("\xe0\x82\x9b"), "\\xe0\\x82\\x9b");
  EXPECT_EQ(printable("\xed\xa0\x80"), "\\xed\\xa0\\x80");  // half of a surrogate pair
  EXPECT_EQ(printable("\xf4\x90\x80\x80"), "\\xf4\\x90\\x80\\x80");
  EXPECT_EQ(printable("\xe2\x80!"), "\\xe2\\x80!");
}

RC_GTEST_PROP(Printable, ChangesNothingTheSecondTime, (const std::string& text)) {
  const std::string once = printable(text);
  RC_ASSERT(printable(once) == once);
}

TEST(Printable, EveryErrorTextIsPrintable) {
  const Error error(ErrorKind::open, "port\x1b[2J", "in use by a\nb", "kill \u202E it");
  EXPECT_STREQ(error.what(), "port\\x1b[2J: in use by a\\x0ab; kill \\xe2\\x80\\xae it");
  EXPECT_EQ(error.problem().thing, "port\x1b[2J") << "programs get the unchanged text";
}

}  // namespace
}  // namespace r4::test
