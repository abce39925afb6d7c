// SPDX-License-Identifier: GPL-3.0-or-later
#include "firmware/bus_choice.hpp"

#include <gtest/gtest.h>

namespace r4::test {
namespace {

using firmware::BusChoice;
using firmware::choose_bus;

constexpr unsigned first = 1;
constexpr unsigned second = 2;

struct Case {
  const char* name;
  unsigned answers;
  ChipTrouble trouble;
  bool has_pca9685;
  BusChoice expected;
};

class BusChoiceTest : public testing::TestWithParam<Case> {};

TEST_P(BusChoiceTest, IsTheBusOfTheWiringUnlessOnlyTheOtherAnswers) {
  const Case& c = GetParam();
  for (const int told : {0, 1}) {
    Wiring wiring = c.has_pca9685 ? plan_wiring() : Wiring();
    wiring.at(SignalKind::chip_bus).byte = static_cast<std::uint8_t>(told);
    const unsigned answers = told == 0 ? c.answers : (c.answers & 1) << 1 | c.answers >> 1;
    const BusChoice choice = choose_bus(wiring, answers, c.trouble);
    EXPECT_EQ(choice.chips, c.expected.chips ^ told);
    EXPECT_EQ(choice.wiring_trouble, c.expected.wiring_trouble);
    EXPECT_EQ(choice.user_may, c.expected.user_may);
  }
}

constexpr auto none = ChipTrouble::none;
constexpr auto not_confirmed = ChipTrouble::not_confirmed;
constexpr auto damaged = ChipTrouble::damaged;
constexpr auto other_bus = ChipTrouble::other_bus;

// The wiring of these cases names the first bus.
constexpr Case cases[] = {
    {"Alone", first, none, true, {0, none, true}},
    {"Both", first | second, none, true, {0, none, true}},
    {"NoChipAnswers", 0, not_confirmed, true, {0, not_confirmed, true}},
    {"Other", second, none, true, {1, other_bus, false}},
    {"OtherNotConfirmed", second, not_confirmed, true, {1, other_bus, false}},
    {"ADeviceOfTheUsersOfABoardWithoutPca9685", second, none, false, {0, none, true}},
    {"AllThatIsKnownOfADamagedWiring", second, damaged, false, {1, damaged, false}},
};
INSTANTIATE_TEST_SUITE_P(Answers, BusChoiceTest, testing::ValuesIn(cases),
                         [](const auto& each) { return each.param.name; });

}  // namespace
}  // namespace r4::test
