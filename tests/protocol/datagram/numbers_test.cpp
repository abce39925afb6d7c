// SPDX-License-Identifier: GPL-3.0-or-later
#include "protocol/datagram/numbers.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <limits>
#include <optional>
#include <random>
#include <string>

namespace r4 {
namespace {

template <class Number>
std::optional<Number> parsed(const std::string& text) {
  constexpr Number untouched = 77;
  Number number = untouched;
  if (parse_number(text, number)) return number;
  EXPECT_EQ(number, untouched) << "refused, but the number was written: " << text;
  return std::nullopt;
}

std::optional<std::int32_t> hundredths(const std::string& text) {
  std::int32_t number = 77;
  if (parse_hundredths(text, number)) return number;
  EXPECT_EQ(number, 77) << text;
  return std::nullopt;
}

std::optional<std::uint32_t> hex(const std::string& text) {
  std::uint32_t number = 77;
  if (parse_hex(text, number)) return number;
  EXPECT_EQ(number, 77U) << text;
  return std::nullopt;
}

template <class Write>
std::string written(Write write) {
  char buffer[max_number_text + 8];
  std::fill(std::begin(buffer), std::end(buffer), '#');
  const char* const end = write(buffer);
  EXPECT_LE(end - buffer, static_cast<std::ptrdiff_t>(max_number_text));
  EXPECT_TRUE(std::all_of(end, static_cast<const char*>(std::end(buffer)), [](char c) {
    return c == '#';
  })) << "written after the end of the number";
  return std::string(buffer, static_cast<std::size_t>(end - buffer));
}

template <class Number>
std::string number_text(Number value) {
  return written([&](char* out) { return write_number(out, value); });
}
std::string hundredths_text(std::int32_t value) {
  return written([&](char* out) { return write_hundredths(out, value); });
}
std::string hex_text(std::uint32_t value) {
  return written([&](char* out) { return write_hex(out, value); });
}

const char* const no_numbers[] = {"",     "-",   "+5", " 5",  "5 ",  "5,6", "5.", "0x5",
                                  "five", "--5", "5-", "1e3", "\t5", "5;",  "²",  "5\n"};

TEST(Numbers, RefusesTextThatIsNotANumber) {
  for (const std::string text : no_numbers) {
    EXPECT_FALSE(parsed<std::uint32_t>(text)) << text;
    EXPECT_FALSE(parsed<std::uint64_t>(text)) << text;
    EXPECT_FALSE(parsed<std::int32_t>(text)) << text;
    EXPECT_FALSE(is_whole_number(text)) << text;
    EXPECT_FALSE(hundredths(text)) << text;
  }
  EXPECT_FALSE(parsed<std::uint32_t>(std::string("5\0", 2)));
}

TEST(Numbers, ParsesUnsigned32BitNumbersUpToTheMaximum) {
  EXPECT_EQ(parsed<std::uint32_t>("0"), 0U);
  EXPECT_EQ(parsed<std::uint32_t>("4294967295"), 4294967295U);
  EXPECT_EQ(parsed<std::uint32_t>("0000000000000000000000000000004294967295"), 4294967295U);
  EXPECT_FALSE(parsed<std::uint32_t>("4294967296"));
  EXPECT_FALSE(parsed<std::uint32_t>("18446744073709551616"));
  EXPECT_FALSE(parsed<std::uint32_t>("18446744073709551617"));
  EXPECT_FALSE(parsed<std::uint32_t>(std::string(1000, '9')));
  EXPECT_FALSE(parsed<std::uint32_t>("-1"));
  EXPECT_FALSE(parsed<std::uint32_t>("-0"));
}

TEST(Numbers, ParsesUnsigned64BitNumbersUpToTheMaximum) {
  EXPECT_EQ(parsed<std::uint64_t>("1699276044383"), 1699276044383U);
  EXPECT_EQ(parsed<std::uint64_t>("18446744073709551615"), 18446744073709551615U);
  EXPECT_EQ(parsed<std::uint64_t>("00018446744073709551615"), 18446744073709551615U);
  EXPECT_FALSE(parsed<std::uint64_t>("18446744073709551616"));
  EXPECT_FALSE(parsed<std::uint64_t>("18446744073709551620"));
  EXPECT_FALSE(parsed<std::uint64_t>("99999999999999999999"));
  EXPECT_FALSE(parsed<std::uint64_t>("184467440737095516150"));
}

TEST(Numbers, ParsesSignedNumbersWithinTheirLimits) {
  EXPECT_EQ(parsed<std::int32_t>("-100"), -100);
  EXPECT_EQ(parsed<std::int32_t>("-0"), 0);
  EXPECT_EQ(parsed<std::int32_t>("2147483647"), 2147483647);
  EXPECT_EQ(parsed<std::int32_t>("-2147483648"), std::numeric_limits<std::int32_t>::min());
  EXPECT_FALSE(parsed<std::int32_t>("2147483648"));
  EXPECT_FALSE(parsed<std::int32_t>("-2147483649"));
}

TEST(Numbers, RecognizesWholeNumbersOfAnySize) {
  for (const std::string text : {"0", "-0", "5", "-5", "99999999999999999999999999"}) {
    EXPECT_TRUE(is_whole_number(text)) << text;
  }
  EXPECT_FALSE(is_whole_number("5.0"));
}

TEST(Numbers, DecimalsAreReadAsHundredths) {
  EXPECT_EQ(hundredths("24.28"), 2428);
  EXPECT_EQ(hundredths("-0.5"), -50);
  EXPECT_EQ(hundredths("-0.05"), -5);
  EXPECT_EQ(hundredths("12"), 1200);
  EXPECT_EQ(hundredths("12.3"), 1230);
  EXPECT_EQ(hundredths("1.999"), 199);
  EXPECT_EQ(hundredths("-1.999"), -199);
  EXPECT_EQ(hundredths("0.00"), 0);
  EXPECT_EQ(hundredths("19999999.99"), 1999999999);
  EXPECT_EQ(hundredths("-19999999.99"), -1999999999);
  for (const std::string text : {"20000000", "20000000.00", "-20000000", ".5", "5.", "-.5", "1.2.3",
                                 "1.-2", "1.2x", "1,2", "nan", "inf", "-", "."}) {
    EXPECT_FALSE(hundredths(text)) << text;
  }
  EXPECT_EQ(hundredths("1." + std::string(38, '9')), 199);
  EXPECT_FALSE(hundredths("1." + std::string(39, '9'))) << "41 characters";
}

TEST(Numbers, BytesInHexadecimalAreTwoDigitsEach) {
  const std::uint8_t bytes[] = {0x00, 0x0F, 0xA5};
  char text[6];
  EXPECT_EQ(write_hex(text, bytes, sizeof bytes), text + 6);
  EXPECT_EQ(std::string(text, 6), "000fa5");
  std::uint8_t back[3] = {};
  EXPECT_TRUE(parse_hex("000FA5", back, sizeof back));
  EXPECT_EQ(back[2], 0xA5);
  EXPECT_FALSE(parse_hex("000fa", back, sizeof back));
  EXPECT_FALSE(parse_hex("000fa5b", back, sizeof back));
  EXPECT_FALSE(parse_hex("000fx5", back, sizeof back));
}

TEST(Numbers, ParsesOneToEightHexadecimalDigitsInEitherCase) {
  EXPECT_EQ(hex("d9bd7e4"), 0x0D9BD7E4U);
  EXPECT_EQ(hex("0D9BD7E4"), 0x0D9BD7E4U);
  EXPECT_EQ(hex("0"), 0U);
  EXPECT_EQ(hex("ffffffff"), 0xFFFFFFFFU);
  for (const std::string text :
       {"", "00d9bd7e4", "g", "0x1", "-1", " 1", "1 ", "@", "`", "/", ":"}) {
    EXPECT_FALSE(hex(text)) << text;
  }
}

TEST(Numbers, WritersGiveTheShortestForm) {
  EXPECT_EQ(number_text(std::uint32_t{0}), "0");
  EXPECT_EQ(number_text(std::int32_t{-1}), "-1");
  EXPECT_EQ(number_text(std::numeric_limits<std::int32_t>::min()), "-2147483648");
  EXPECT_EQ(number_text(std::numeric_limits<std::uint64_t>::max()), "18446744073709551615");
  EXPECT_EQ(number_text(std::uint64_t{4294967296}), "4294967296");
  EXPECT_EQ(number_text(std::uint64_t{10000000000000000}), "10000000000000000");
  EXPECT_EQ(hundredths_text(0), "0.00");
  EXPECT_EQ(hundredths_text(-5), "-0.05");
  EXPECT_EQ(hundredths_text(2428), "24.28");
  EXPECT_EQ(hundredths_text(std::numeric_limits<std::int32_t>::min()), "-21474836.48");
  EXPECT_EQ(hex_text(0), "0");
  EXPECT_EQ(hex_text(0x0D9BD7E4U), "d9bd7e4");
  EXPECT_EQ(hex_text(0xFFFFFFFFU), "ffffffff");
}

TEST(Numbers, AgreeWithTheStandardLibraryAtEveryLength) {
  std::mt19937_64 random(1);
  for (int bits = 1; bits <= 64; ++bits) {
    for (int i = 0; i < 200; ++i) {
      const std::uint64_t value = random() >> (64 - bits);
      ASSERT_EQ(number_text(value), std::to_string(value));
      ASSERT_EQ(parsed<std::uint64_t>(std::to_string(value)), value);
      const auto low = static_cast<std::uint32_t>(value);
      ASSERT_EQ(number_text(low), std::to_string(low));
      const auto with_sign = static_cast<std::int32_t>(low);
      ASSERT_EQ(number_text(with_sign), std::to_string(with_sign));
      char expected[16];
      std::snprintf(expected, sizeof expected, "%x", low);
      ASSERT_EQ(hex_text(low), expected);
      ASSERT_EQ(hex(expected), low);
    }
  }
  std::uint64_t power = 1;
  for (int digits = 1; digits <= 19; ++digits, power *= 10) {
    for (const std::uint64_t value : {power - 1, power, power + 1}) {
      const std::string text = std::to_string(value);
      ASSERT_EQ(number_text(value), text);
      ASSERT_EQ(parsed<std::uint64_t>(text), value);
      for (std::size_t i = 0; i < text.size(); ++i) {
        for (const char wrong : {'/', ':', '-', ' ', '\xB5'}) {
          std::string damaged = text;
          damaged[i] = wrong;
          ASSERT_FALSE(parsed<std::uint64_t>(damaged)) << damaged;
        }
      }
    }
  }
}

TEST(Numbers, HundredthsRoundTrip) {
  for (std::int32_t value = -200000; value <= 200000; ++value) {
    ASSERT_EQ(hundredths(hundredths_text(value)), value);
  }
}

}  // namespace
}  // namespace r4
