// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/r4/ros2/setpoint_units.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <optional>

#include "r4link/commands/command_text.hpp"
#include "tests/support/problems.hpp"
#include "tools/r4/ros2/bridge.hpp"
#include "tools/r4/ros2/command_text.hpp"

namespace r4::tool::ros2 {
namespace {

constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
constexpr double infinite = std::numeric_limits<double>::infinity();

TEST(Ros2Units, ADutyOfAStateCommandsTheSamePwm) {
  for (int pwm = 0; pwm <= 4095; ++pwm) {
    EXPECT_EQ(Duty(to_duty(pwm, Direction::forward)).pwm().value, pwm);
    EXPECT_EQ(Duty(to_duty(pwm, Direction::reverse)).pwm().value, pwm);
  }
}

TEST(Ros2Units, RefusesADutyOutsideItsRange) {
  const MotorChannel motor{CommandKind::osmc, 1, false};
  EXPECT_TRUE(motor.command(-1));
  for (const double wrong : {1.0001, -1.0001, not_a_number, infinite, -infinite}) {
    EXPECT_FALSE(motor.command(wrong)) << wrong;
  }
}

std::optional<int> to_us(const ServoUnit& unit, double value) {
  const auto pulse = to_pulse(unit, value);
  return pulse ? std::optional(pulse->value) : std::nullopt;
}

TEST(Ros2Units, AServoTurnsByItsCalibration) {
  const ServoUnit usual = servo_unit(BridgeOptions().servo);
  EXPECT_EQ(to_us(usual, 0), 1500);
  EXPECT_EQ(to_us(usual, M_PI / 2), 2500);
  EXPECT_EQ(to_us(usual, -M_PI / 2), 500);
  EXPECT_EQ(to_us(usual, static_cast<float>(M_PI / 2)), 2500) << "a topic carries a float";
  for (const double wrong : {1.6, not_a_number, infinite, std::numeric_limits<double>::max()}) {
    EXPECT_FALSE(to_pulse(usual, wrong)) << wrong;
  }
  EXPECT_NEAR(from_pulse(usual, 2000), M_PI / 4, 1e-9);
  EXPECT_TRUE(std::isnan(from_pulse(usual, 0)));
  const ServoUnit narrow = servo_unit("1000,2000,1.0");
  EXPECT_EQ(to_us(narrow, 0.25), 1750);
  EXPECT_FALSE(to_pulse(narrow, 0.6));
  const ServoUnit pulses = servo_unit("us");
  EXPECT_EQ(to_us(pulses, 1234), 1234);
  EXPECT_EQ(to_us(pulses, 0), 0);
  EXPECT_EQ(from_pulse(pulses, 1234), 1234);
  for (const double wrong : {2501.0, -1.0, not_a_number, infinite}) {
    EXPECT_FALSE(to_pulse(pulses, wrong)) << wrong;
  }
  for (const char* wrong :
       {"", "1,2", "2000,1000,1", "500,2501,1", "500,2500,0", "a,b,c", "1,2,3,4"}) {
    EXPECT_THROW(servo_unit(wrong), Error) << wrong;
  }
}

TEST(Ros2Units, ATwistDrivesTwoWheelsAndKeepsTheirRatio) {
  const DifferentialDrive drive = differential_drive("osmc1,-osmc2", 0.5, 2.0);
  EXPECT_EQ(to_text(*drive.setpoints(1, 0)), "O:2048,1,1;O:2048,0,2");
  EXPECT_EQ(to_text(*drive.setpoints(0, 2)), "O:1024,0,1;O:1024,0,2");
  EXPECT_EQ(to_text(*drive.setpoints(4, 0)), "O:4095,1,1;O:4095,0,2");
  EXPECT_EQ(to_text(*drive.setpoints(4, 8)), "O:1365,1,1;O:4095,0,2") << "the ratio stays 1 to 3";
  EXPECT_FALSE(drive.setpoints(not_a_number, 0));
  EXPECT_FALSE(drive.setpoints(0, infinite));
  EXPECT_EQ(to_text(*differential_drive("dhb12_3,dhb12_4", 1, 1).setpoints(0.5, 0)),
            "D:2048,1,3;D:2048,1,4");
  for (const char* wrong : {"", "osmc1", "osmc1,osmc1", "osmc1,-osmc1", "osmc5,osmc1",
                            "osmc1,servo1", "osmc1,osmc2,osmc3", "osmc,osmc2"}) {
    EXPECT_THROW(differential_drive(wrong, 1, 1), Error) << wrong;
  }
}

TEST(Ros2CommandText, AStringMustEndWithItsOnlyNul) {
  EXPECT_EQ(text_of(std::string_view("O:1,1,1\0", 8)), "O:1,1,1");
  EXPECT_EQ(text_of(std::string_view("\0", 1)), "");
  for (const std::string& bad : {std::string(), std::string("O:1,1,1"),
                                 std::string("E:STOP\0x\0", 9), std::string(2000, 'x') + '\0'}) {
    EXPECT_FALSE(text_of(std::string_view(bad))) << bad;
  }
}

TEST(Ros2CommandText, AnErrorDoesNotRepeatInvalidCharacters) {
  for (const char* wrong : {"O:\xff", "O:1,1,1;\xc3", "\x01"}) {
    EXPECT_EQ(test::problem_of([&] { (void)commands_of(wrong); }).text(),
              "a command: has characters that are not ASCII; write the command in ASCII");
  }
}

TEST(Ros2CommandText, ParsesSeveralCommandsAndRefusesOthers) {
  const auto commands = commands_of(" O:358,1,1 ;S:1500,2;\n");
  ASSERT_EQ(commands.size(), 2U);
  EXPECT_EQ(to_text(commands[0]), "O:358,1,1");
  EXPECT_EQ(to_text(commands[1]), "S:1500,2");
  EXPECT_TRUE(commands_of(" ; ").empty());
  for (const char* wrong :
       {"O:358,1,1;X", "C:timeout,9000", "H:ROS2-R4", "E:LEAVE", "W:100", "F:AIN24", "O:358,1,9"}) {
    EXPECT_THROW(commands_of(wrong), Error) << wrong;
  }
  EXPECT_TRUE(asks_to_stop("nonsense\xff; E:STOP ;O:1,1,1"));
  EXPECT_FALSE(asks_to_stop("E:STOPPED;E:CLEAR"));
}

TEST(CommandStamp, IsOutdatedAfterTheDeadlineUnlessItIsZero) {
  using namespace std::chrono_literals;
  const WallTime now(1000s);
  EXPECT_FALSE(is_outdated(stamp_time(999, 500'000'000), now, 500ms));
  EXPECT_TRUE(is_outdated(stamp_time(999, 499'999'999), now, 500ms));
  EXPECT_FALSE(is_outdated(stamp_time(1001, 0), now, 500ms)) << "the sender's clock is ahead";
  EXPECT_FALSE(is_outdated(stamp_time(0, 0), now, 500ms));
  EXPECT_FALSE(is_outdated(stamp_time(1, 0), now, 0ms)) << "0 ms means no deadline";
}

TEST(CounterPosition, BeginsWithTheCountAndFollowsItBothWays) {
  Position position;
  EXPECT_EQ(position.advance(-5, 7), -5);
  EXPECT_EQ(position.advance(10, 7), 10);
  EXPECT_EQ(position.advance(-20, 7), -20);
  EXPECT_EQ(position.advance(3, 8), -20) << "a restart of the board must not move the position";
  EXPECT_EQ(position.advance(2, 8), -21);
  constexpr std::int32_t last = std::numeric_limits<std::int32_t>::max();
  Position over;
  EXPECT_EQ(over.advance(last - 9, 7), last - 9);
  EXPECT_EQ(over.advance(-last, 7), std::int64_t{last} + 2) << "the count has wrapped";
}

}  // namespace
}  // namespace r4::tool::ros2
