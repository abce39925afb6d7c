// SPDX-License-Identifier: GPL-3.0-or-later
#include "pin_models.hpp"

namespace r4::test {

namespace {

using namespace firmware;

Drive drive_of(const sim::Pca9685Model& chip, const DriveLines& lines) {
  const int duty = chip.duty(lines.pwm);
  return {static_cast<std::uint16_t>(duty == 4096 ? 4095 : duty),
          chip.high(lines.direction) ? Direction::forward : Direction::reverse};
}

bool all_off(const sim::Pca9685Model& chip) {
  for (int i = 0; i < sim::Pca9685Model::channels; ++i) {
    if (chip.duty(i) != 0) return false;
  }
  return true;
}

}  // namespace

Outputs outputs_of(const BoardModel& board) {
  Outputs outputs;
  for (int i = 0; i < osmc_channels; ++i) {
    outputs.osmc[i] = drive_of(board.osmc, osmc_lines[i]);
    outputs.dhb12[i] = drive_of(board.dhb12, dhb12_lines[i]);
  }
  for (int i = 0; i < servo_channels; ++i) {
    outputs.servo_us[i] = static_cast<std::uint16_t>(board.servo.duty(servo_lines[i]));
  }
  const int a = board.expander.level(0) & board.expander.driven(0);
  for (int i = 0; i < bldc_channels; ++i) {
    const BldcLines& lines = bldc_lines[i];
    outputs.bldc[i].speed = board.dac.output(lines.speed).code;
    outputs.bldc[i].direction =
        (a >> lines.direction & 1) != 0 ? Direction::forward : Direction::reverse;
    outputs.bldc[i].brake = (a >> lines.brake & 1) != 0;
  }
  const int b = board.expander.level(1) & board.expander.driven(1);
  for (int i = 0; i < relay_channels; ++i) {
    if ((b >> relay_bits[i] & 1) != 0) outputs.relays |= static_cast<std::uint8_t>(1 << i);
  }
  return outputs;
}

Outputs as_pins(Outputs outputs) {
  for (StepperTarget& target : outputs.stepper) target = {};
  for (std::uint16_t& us : outputs.servo_us) {
    us = static_cast<std::uint16_t>((us * 25 + 61) / 122);
  }
  return outputs;
}

bool is_safe(const BoardModel& board) {
  bool safe = all_off(board.osmc) && all_off(board.dhb12) && all_off(board.servo);
  for (int i = 0; i < bldc_channels; ++i) safe = safe && board.dac.volts(i) == 0;
  const int a = board.expander.level(0) & board.expander.driven(0);
  const int b = board.expander.level(1) & board.expander.driven(1);
  return safe && (a & brakes_on) == brakes_on && b == 0;
}

}  // namespace r4::test
