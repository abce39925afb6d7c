// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/key.hpp"

#include <gtest/gtest.h>

#include <string>

#include "tests/support/datagrams.hpp"

namespace r4 {
namespace {

const std::string digits = "00112233445566778899AABBCCDDEEFF00112233445566778899aabbccddeeff";

TEST(Key, IsReadFromItsTextAndWrittenInLowerCase) {
  Key key;
  ASSERT_EQ(parse_key(Text("7:" + digits), key), Refusal::none);
  EXPECT_EQ(key.id, 7);
  EXPECT_EQ(key.bytes[1], 0x11);
  EXPECT_EQ(key.bytes[31], 0xFF);
  char text[key_text_size];
  EXPECT_EQ(write_key(text, key), text + sizeof text);
  EXPECT_EQ(test::str(Text(text, sizeof text)),
            "7:00112233445566778899aabbccddeeff00112233445566778899aabbccddeeff");
}

TEST(Key, RefusesInvalidForms) {
  struct Case {
    std::string text;
    Refusal refusal;
  };
  const Case cases[] = {
      {"", Refusal::format},
      {digits, Refusal::format},
      {":" + digits, Refusal::format},
      {"x:" + digits, Refusal::format},
      {"+1:" + digits, Refusal::format},
      {"0:" + digits, Refusal::range},
      {"10:" + digits, Refusal::range},
      {"-1:" + digits, Refusal::range},
      {"99999999999999999999:" + digits, Refusal::range},
      {"1:", Refusal::format},
      {"1:" + digits.substr(1), Refusal::format},
      {"1:" + digits + "0", Refusal::format},
      {"1: " + digits.substr(1), Refusal::format},
      {"1:g" + digits.substr(1), Refusal::format},
      {"1:" + digits.substr(1) + "^", Refusal::format},
  };
  for (const Case& c : cases) {
    Key key;
    EXPECT_EQ(parse_key(Text(c.text), key), c.refusal) << c.text;
    EXPECT_TRUE(key == Key()) << c.text;
  }
}

}  // namespace
}  // namespace r4
