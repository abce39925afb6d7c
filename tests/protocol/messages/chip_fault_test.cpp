// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include <set>
#include <string>

#include "firmware/board_hardware.hpp"
#include "r4link/vocabulary.hpp"

namespace r4 {
namespace {

TEST(ChipFault, EveryChipOfTheBoardHasItsName) {
  std::set<std::string> names;
  for (int i = 0; i < chip_count; ++i) {
    names.insert(chip_name(plan_wiring().chip(static_cast<Chip>(i)).number()));
  }
  EXPECT_EQ(names.size(), static_cast<std::size_t>(chip_count));
  EXPECT_EQ(names.count("unknown chip"), 0U);
  EXPECT_STREQ(chip_name(0x70), "unknown chip");
  EXPECT_STREQ(chip_name(0), "wiring");
}

TEST(ChipFault, EachTroubleNumberHasItsText) {
  const char* const texts[] = {"none",           "no acknowledge", "bus stuck",     "was reset",
                               "wrong register", "not ready",      "not confirmed", "damaged",
                               "other bus",      "unknown"};
  for (std::uint8_t i = 0; i < std::size(texts); ++i) {
    EXPECT_STREQ(to_text(static_cast<ChipTrouble>(i)), texts[i]);
  }
  EXPECT_TRUE((ChipFault{64, ChipTrouble::was_reset}).any());
  EXPECT_FALSE(ChipFault().any());
}

}  // namespace
}  // namespace r4
