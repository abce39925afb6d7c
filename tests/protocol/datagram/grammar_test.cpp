// SPDX-License-Identifier: GPL-3.0-or-later
#include "protocol/datagram/grammar.hpp"

#include <gtest/gtest.h>

#include <string>

namespace r4 {
namespace {

// A second implementation of the grammar in datagram.hpp, byte by byte.
bool in_name(int c) {
  return c >= 0x21 && c <= 0x7E && c != ':' && c != ';' && c != ',' && c != '^';
}
bool in_value(int c) { return c >= 0x20 && c <= 0x7E && c != ',' && c != ';' && c != '^'; }

TEST(Grammar, EveryByteHasItsClasses) {
  for (int c = 0; c < 256; ++c) {
    const char byte = static_cast<char>(c);
    EXPECT_EQ(is_in(ByteClasses::in_name, byte), in_name(c)) << c;
    EXPECT_EQ(is_in(ByteClasses::in_value, byte), in_value(c)) << c;
    EXPECT_EQ(is_in(ByteClasses::in_values, byte), in_value(c) || c == ',') << c;
  }
}

TEST(Grammar, FindsSeparatorsAtEveryPositionOfEverySize) {
  for (std::size_t size = 1; size <= separators_block + 18; ++size) {
    for (std::size_t at = 0; at < size; ++at) {
      const std::uint64_t bit = std::uint64_t{1} << at % separators_block;
      for (int c = 0; c < 256; ++c) {
        // separate memory, so that the sanitizer reports a read past its end
        std::string text(size, 'x');
        text[at] = static_cast<char>(c);
        const Separators found = separators(text, at - at % separators_block);
        ASSERT_EQ(found.colons, c == ':' ? bit : 0) << c;
        ASSERT_EQ(found.semicolons, c == ';' ? bit : 0) << c;
        ASSERT_EQ(found.no_name, in_name(c) || c == ':' ? 0 : bit) << c;
        ASSERT_EQ(found.no_field, in_value(c) || c == ',' || c == ';' ? 0 : bit) << c;
      }
    }
  }
}

TEST(Grammar, SkipStopsAtTheFirstByteOutsideTheClass) {
  const std::string text = "AIN24:1,2;";
  const char* const begin = text.data();
  const char* const end = begin + text.size();
  EXPECT_EQ(skip(ByteClasses::in_name, begin, end) - begin, 5);
  EXPECT_EQ(skip(ByteClasses::in_value, begin, end) - begin, 7);
  EXPECT_EQ(skip(ByteClasses::in_values, begin, end) - begin, 9);
  EXPECT_EQ(skip(ByteClasses::in_values, begin, begin), begin);
  EXPECT_EQ(skip(ByteClasses::in_name, begin, begin + 3), begin + 3);
}

}  // namespace
}  // namespace r4
