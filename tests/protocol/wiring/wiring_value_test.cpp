// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/wiring/wiring_value.hpp"

#include <gtest/gtest.h>

#include <string>

#include "protocol/datagram/crc32.hpp"
#include "tests/support/datagrams.hpp"
#include "tests/support/random_wiring.hpp"

namespace r4 {
namespace {

std::string value_of(const Wiring& wiring) {
  char out[max_wiring_value];
  return test::str(write_wiring_value(wiring, out));
}

std::string with_checksum(const std::string& text) {
  char crc[9];
  std::snprintf(crc, sizeof crc, "%x", static_cast<unsigned>(crc32(text)));
  return text + ":" + crc;
}

TEST(WiringValue, IsReadAsItWasWritten) {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    const Wiring wiring = test::random_wiring(seed);
    Wiring read;
    ASSERT_EQ(read_wiring_value(value_of(wiring), read), Refusal::none) << seed;
    EXPECT_EQ(read, wiring);
  }
  EXPECT_EQ(value_of(plan_wiring()).substr(0, 18), "1:0040414220612a02");
}

TEST(WiringValue, EveryChangedCharacterIsNoticed) {
  const std::string value = value_of(plan_wiring());
  for (std::size_t i = 0; i < value.size(); ++i) {
    for (const char c : {'0', '1', 'f', ':', 'x', '\0'}) {
      std::string damaged = value;
      if (damaged[i] == c) continue;
      damaged[i] = c;
      Wiring read;
      EXPECT_EQ(read_wiring_value(damaged, read), Refusal::format) << i << c;
      EXPECT_EQ(read, Wiring()) << "a refusal changes nothing";
    }
    Wiring read;
    EXPECT_EQ(read_wiring_value(value.substr(0, i), read), Refusal::format) << "cut at " << i;
  }
}

TEST(WiringValue, AWrongWiringIsOutOfRange) {
  Wiring wiring = plan_wiring();
  wiring.at(SignalKind::handle).byte = 20;
  Wiring read;
  EXPECT_EQ(read_wiring_value(value_of(wiring), read), Refusal::range);
  std::string other = value_of(plan_wiring());
  other = other.substr(0, other.rfind(':'));
  other[0] = '2';
  EXPECT_EQ(read_wiring_value(with_checksum(other), read), Refusal::format) << "another version";
}

TEST(WiringValue, TheAnswerHasSourceUseAndWiring) {
  for (const WiringSource source :
       {WiringSource::plan, WiringSource::given, WiringSource::damaged}) {
    for (const bool in_use : {false, true}) {
      BoardWiring kept;
      kept.source = source;
      kept.in_use = in_use;
      kept.wiring = source == WiringSource::damaged ? Wiring() : plan_wiring();
      char out[max_board_wiring];
      const std::string text = test::str(write_board_wiring(kept, out));
      BoardWiring read;
      ASSERT_TRUE(read_board_wiring(text, read)) << text;
      EXPECT_EQ(read.source, source);
      EXPECT_EQ(read.in_use, in_use);
      EXPECT_EQ(read.wiring, kept.wiring);
      for (std::size_t i = 0; i < text.size(); ++i) {
        EXPECT_FALSE(read_board_wiring(text.substr(0, i), read)) << i;
      }
    }
  }
}

}  // namespace
}  // namespace r4
