// SPDX-License-Identifier: GPL-3.0-or-later
#include "firmware/executor.hpp"

#include <gtest/gtest.h>

namespace r4::firmware {
namespace {

bool same(const Setpoints& a, const Setpoints& b) {
  return a.outputs == b.outputs && a.fields == b.fields &&
         std::equal(std::begin(a.proximity_cm), std::end(a.proximity_cm), b.proximity_cm) &&
         a.settings.state_rate_hz == b.settings.state_rate_hz &&
         a.settings.heartbeat_ms == b.settings.heartbeat_ms &&
         a.settings.timeout_ms == b.settings.timeout_ms &&
         a.settings.recovery == b.settings.recovery && a.settings.pack == b.settings.pack;
}

TEST(Executor, ChangesOnlyWhatTheCommandNames) {
  Setpoints setpoints;
  Setpoints expected;
  auto expect = [&](const Command& command) {
    EXPECT_EQ(carry_out(command, setpoints), Refusal::none);
    EXPECT_TRUE(same(setpoints, expected)) << static_cast<int>(command.kind);
  };

  expected.outputs.relays = 0x01;
  expect(Command::relay(1, true));
  expected.outputs.osmc[0] = {4095, Direction::forward};
  expect(Command::osmc(1, Pwm(4095), Direction::forward));
  expected.outputs.dhb12[3] = {1, Direction::forward};
  expect(Command::dhb12(4, Pwm(1), Direction::forward));
  expected.outputs.servo_us[15] = 2500;
  expect(Command::servo(16, Microseconds(2500)));
  expected.outputs.relays = 0x81;
  expect(Command::relay(8, true));
  expect(Command::relay(1, true));
  expected.outputs.relays = 0x01;
  expect(Command::relay(8, false));
  expected.outputs.stepper[1].position = -5;
  expected.outputs.stepper[1].speed = 20;
  expected.outputs.stepper[1].enabled = true;
  expect(Command::stepper(2, Steps(-5), StepsPerSecond(20)));
  expected.outputs.bldc[2] = {9, Direction::reverse, true};
  expect(Command::bldc(3, Pwm(9), Direction::reverse, true));
  expected.proximity_cm[3] = 400;
  expect(Command::proximity(4, Centimetres(400)));
  expected.fields = FieldSet();
  expected.fields.add(StateField::ain5);
  expect(Command::fields("AIN5"));
  expected.settings.state_rate_hz = 10;
  expect(Command::setting("rate", "10"));
  expected.outputs.stepper[1] = StepperTarget();
  expect(Command::zero(2));
  for (const Command& command :
       {Command::heartbeat(), Command::stop(), Command::clear(), Command::identify()}) {
    expect(command);
  }
}

TEST(Executor, ClosingTheMotorSupplyMovesNothing) {
  Setpoints setpoints;
  carry_out(Command::osmc(4, Pwm(500), Direction::forward), setpoints);
  carry_out(Command::dhb12(2, Pwm(500), Direction::forward), setpoints);
  carry_out(Command::bldc(3, Pwm(500), Direction::forward, false), setpoints);
  carry_out(Command::stepper(1, Steps(500), StepsPerSecond(20)), setpoints);
  carry_out(Command::dac(1, Millivolts(3000)), setpoints);
  carry_out(Command::servo(1, Microseconds(1500)), setpoints);
  carry_out(Command::relay(2, true), setpoints);
  carry_out(Command::relay(1, true), setpoints);
  const Outputs& outputs = setpoints.outputs;
  EXPECT_EQ(outputs.osmc[3].pwm, 0);
  EXPECT_EQ(outputs.dhb12[1].pwm, 0);
  EXPECT_EQ(outputs.bldc[2].speed, 0);
  EXPECT_FALSE(outputs.bldc[2].brake) << "a brake stays as it is";
  EXPECT_FALSE(outputs.stepper[0].enabled);
  EXPECT_EQ(outputs.dac_mv[0], 0) << "a DAC may be the throttle of a motor";
  EXPECT_EQ(outputs.servo_us[0], 1500) << "relay 1 does not supply the servos";
  EXPECT_EQ(outputs.relays, 0b11);

  carry_out(Command::osmc(4, Pwm(500), Direction::forward), setpoints);
  carry_out(Command::relay(1, true), setpoints);
  EXPECT_EQ(outputs.osmc[3].pwm, 500) << "the relay is closed already";
}

TEST(Executor, ChangesNothingWhenItRefuses) {
  Setpoints setpoints;
  carry_out(Command::osmc(1, Pwm(1), Direction::forward), setpoints);
  const Setpoints before = setpoints;
  const std::pair<Command, Refusal> cases[] = {
      {Command::osmc(5, Pwm(1), Direction::forward), Refusal::channel},
      {Command::servo(0, Microseconds(1)), Refusal::channel},
      {Command::relay(9, true), Refusal::channel},
      {Command::zero(5), Refusal::channel},
      {Command::proximity(255, Centimetres(1)), Refusal::channel},
      {Command::fields("AIN24,NONSENSE"), Refusal::unknown},
      {Command::setting("rate", "1001"), Refusal::range},
      {Command::setting("rate", "x"), Refusal::format},
      {Command::setting("nonsense", "1"), Refusal::unknown},
      {Command::setting("heartbeat", "1000"), Refusal::range},  // must be less than the timeout
  };
  for (const auto& [command, refusal] : cases) {
    EXPECT_EQ(carry_out(command, setpoints), refusal) << static_cast<int>(command.kind);
    EXPECT_TRUE(same(setpoints, before)) << static_cast<int>(command.kind);
  }
}

TEST(Executor, TheDefaultOutputsAreTheSafeOnes) {
  const Outputs outputs;
  for (const Drive& drive : outputs.osmc) EXPECT_EQ(drive.pwm, 0);
  for (const Drive& drive : outputs.dhb12) EXPECT_EQ(drive.pwm, 0);
  for (const std::uint16_t us : outputs.servo_us) EXPECT_EQ(us, 0);
  for (const Bldc& bldc : outputs.bldc) EXPECT_EQ(bldc.speed, 0);
  for (const StepperTarget& stepper : outputs.stepper) EXPECT_FALSE(stepper.enabled);
  EXPECT_EQ(outputs.relays, 0);
}

TEST(Executor, OutputsDifferInEveryMember) {
  const Outputs base;
  auto differs = [&](auto change) {
    Outputs other;
    change(other);
    return other != base;
  };
  EXPECT_FALSE(differs([](Outputs&) {}));
  EXPECT_TRUE(differs([](Outputs& o) { o.osmc[3].pwm = 1; }));
  EXPECT_TRUE(differs([](Outputs& o) { o.osmc[0].direction = Direction::forward; }));
  EXPECT_TRUE(differs([](Outputs& o) { o.dhb12[3].pwm = 1; }));
  EXPECT_TRUE(differs([](Outputs& o) { o.servo_us[15] = 1; }));
  EXPECT_TRUE(differs([](Outputs& o) { o.relays = 1; }));
  EXPECT_TRUE(differs([](Outputs& o) { o.bldc[3].speed = 1; }));
  EXPECT_TRUE(differs([](Outputs& o) { o.bldc[3].brake = false; }));
  EXPECT_TRUE(differs([](Outputs& o) { o.bldc[3].direction = Direction::forward; }));
  EXPECT_TRUE(differs([](Outputs& o) { o.stepper[3].position = 1; }));
  EXPECT_TRUE(differs([](Outputs& o) { o.stepper[3].speed = 1; }));
  EXPECT_TRUE(differs([](Outputs& o) { o.stepper[3].enabled = true; }));
}

}  // namespace
}  // namespace r4::firmware
