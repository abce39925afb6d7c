// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/setpoints.hpp"

#include <gtest/gtest.h>

#include "host/commands/command_help.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

TEST(Setpoints, AreTheCommandsInTheirOrder) {
  const Setpoints all = Setpoints{}
                            .osmc(1, 358, Direction::forward)
                            .dhb12(2, 7, Direction::reverse)
                            .servo(3, 1500)
                            .relay(1, true)
                            .stepper(4, -100, 500)
                            .stepper(3, 5)
                            .zero(4)
                            .bldc(2, 9, Direction::forward, true)
                            .dac(1, 1650)
                            .add(Command::osmc(0, Direction::forward, 2));
  EXPECT_EQ(text_of(all),
            "O:358,1,1;D:7,0,2;S:1500,3;R:1,On;P:-100,500,4;P:5,1000,3;Z:4;B:9,1,1,2;X:DAC,1,1650;"
            "O:0,1,2");
  EXPECT_EQ(text_of(parse_group_text(text_of(all) + ";")), text_of(all));
  EXPECT_EQ(all.size(), 10U);
  EXPECT_TRUE(Setpoints{}.empty());
}

TEST(Setpoints, CanBeSentAsTheyAre) {
  Setpoints setpoints;
  setpoints.osmc(1, 358, Direction::forward);
  EXPECT_TRUE(
      contains(problem_of([&] { setpoints.osmc(5, 1, Direction::forward); }).reason, "channel"));
  EXPECT_TRUE(contains(problem_of([&] { setpoints.servo(1, 2501); }).reason, "range"));
  EXPECT_TRUE(contains(problem_of([&] { setpoints.dac(1, 3301); }).reason, "range"));
  EXPECT_TRUE(contains(problem_of([&] { setpoints.add(Command::uart_write(1, "x41")); }).reason,
                       "a transfer of its own"));
  const Problem twice = problem_of([&] { setpoints.osmc(1, 5, Direction::forward); });
  EXPECT_EQ(twice.kind, ErrorKind::usage);
  EXPECT_EQ(twice.thing, "O:5,1,1");
  EXPECT_TRUE(contains(twice.reason, "same channel"));
  for (const Command& command : {Command::stop(), Command::proximity(5, 1), Command::fields("ALL"),
                                 Command::setting("rate", "50"), Command::identify()}) {
    EXPECT_TRUE(contains(problem_of([&] { setpoints.add(command); }).reason, "no output"));
  }
  EXPECT_EQ(setpoints.size(), 1U) << "what was refused is not in it";
  for (int i = 1; i <= 15; ++i) setpoints.servo(i, 1500);
  EXPECT_TRUE(contains(problem_of([&] { setpoints.servo(16, 1500); }).reason, "16"));
  EXPECT_EQ(setpoints.size(), 16U);
}

TEST(Setpoints, InATextAreSeparatedBySemicolons) {
  EXPECT_TRUE(is_group_text("O:1,1,1;O:1,1,2"));
  EXPECT_TRUE(is_group_text("O:1,1,1;;"));
  EXPECT_FALSE(is_group_text("O:1,1,1;"));
  EXPECT_FALSE(is_group_text(""));
  EXPECT_EQ(problem_of([] { parse_group_text("O:1,1,1;O:1,1,5"); }).thing, "O:1,1,5");
  EXPECT_EQ(problem_of([] { parse_group_text("O:1,1,1;E:STOP"); }).thing, "E:STOP");
  for (const char* text : {"O:1,1,1;;", ";O:1,1,1", "O:1,1,1;;O:1,1,2", ";;"}) {
    EXPECT_EQ(problem_of([&] { parse_group_text(text); }).kind, ErrorKind::usage) << text;
  }
}

TEST(Setpoints, ThePartOfAText) {
  EXPECT_EQ(part_of("a;b;c", 1), "a");
  EXPECT_EQ(part_of("a;b;c", 2), "b");
  EXPECT_EQ(part_of("a;b;c", 3), "c");
  EXPECT_EQ(part_of("a;b;c", 0), "a;b;c");
  EXPECT_EQ(part_of("a;b;c", 4), "a;b;c");
  EXPECT_EQ(part_of("", 1), "");
  EXPECT_EQ(part_of("a", 1), "a");
}

}  // namespace
}  // namespace r4::test
