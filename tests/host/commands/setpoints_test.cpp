// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/setpoints.hpp"

#include <gtest/gtest.h>

#include "r4link/commands/command_text.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

TEST(Setpoints, KeepTheirCommandsInOrder) {
  const Setpoints all = {Command::osmc(1, Pwm(358), Direction::forward),
                         Command::dhb12(2, Duty(-0.1)),
                         Command::servo(3, Microseconds(1500)),
                         Command::relay(1, true),
                         Command::stepper(4, Steps(-100), StepsPerSecond(500)),
                         Command::stepper(3, Steps(5)),
                         Command::zero(4),
                         Command::bldc(2, Pwm(9), Direction::forward, true),
                         Command::dac(1, Millivolts(1650)),
                         Command::osmc(2, Pwm(0), Direction::forward)};
  EXPECT_EQ(to_text(all),
            "O:358,1,1;D:410,0,2;S:1500,3;R:1,On;P:-100,500,4;P:5,1000,3;Z:4;B:9,1,1,2;"
            "X:DAC,1,1650;O:0,1,2");
  EXPECT_EQ(to_text(std::get<Setpoints>(parse_text(to_text(all) + ";"))), to_text(all));
  EXPECT_EQ(all.size(), 10U);
  EXPECT_TRUE(Setpoints{}.empty());
}

TEST(Setpoints, RefuseInvalidCommandsWhenTheyAreAdded) {
  Setpoints setpoints{Command::osmc(1, Pwm(358), Direction::forward)};
  const auto refusal_of = [&](const Command& command) {
    return problem_of([&] { setpoints.add(command); });
  };
  EXPECT_TRUE(contains(refusal_of(Command::osmc(5, Duty(0))).reason, "channel"));
  EXPECT_TRUE(contains(refusal_of(Command::osmc(2, Duty(1.01))).reason, "range"));
  EXPECT_TRUE(contains(refusal_of(Command::servo(1, Microseconds(2501))).reason, "range"));
  EXPECT_TRUE(contains(refusal_of(Command::dac(1, Millivolts(3301))).reason, "range"));
  EXPECT_TRUE(contains(refusal_of(Command::uart_write(1, "x41")).reason, "a transfer of its own"));
  const Problem twice = refusal_of(Command::osmc(1, Pwm(5), Direction::forward));
  EXPECT_EQ(twice.kind, ErrorKind::usage);
  EXPECT_EQ(twice.thing, "O:5,1,1");
  EXPECT_TRUE(contains(twice.reason, "its channel"));
  for (const Command& command :
       {Command::stop(), Command::proximity(1, Centimetres(5)), Command::fields("ALL"),
        Command::setting("rate", "50"), Command::identify()}) {
    EXPECT_TRUE(contains(refusal_of(command).reason, "no output"));
  }
  EXPECT_EQ(setpoints.size(), 1U) << "a refused command must not be in the group";
  for (int i = 1; i <= 15; ++i) setpoints.add(Command::servo(i, Microseconds(1500)));
  EXPECT_TRUE(contains(refusal_of(Command::servo(16, Microseconds(1500))).reason, "16"));
  EXPECT_EQ(setpoints.size(), 16U);
}

TEST(Setpoints, AreSeparatedBySemicolonsInText) {
  EXPECT_EQ(std::get<Setpoints>(parse_text("O:1,1,1;O:1,1,2")).size(), 2U);
  EXPECT_TRUE(std::holds_alternative<OwnCommand>(parse_text("O:1,1,1;")));
  EXPECT_EQ(problem_of([] { parse_text("O:1,1,1;O:1,1,5"); }).thing, "O:1,1,5");
  EXPECT_EQ(problem_of([] { parse_text("O:1,1,1;E:STOP"); }).thing, "E:STOP");
  for (const char* text : {"O:1,1,1;;", ";O:1,1,1", "O:1,1,1;;O:1,1,2", ";;", ""}) {
    EXPECT_EQ(problem_of([&] { parse_text(text); }).kind, ErrorKind::usage) << text;
  }
}

}  // namespace
}  // namespace r4::test
