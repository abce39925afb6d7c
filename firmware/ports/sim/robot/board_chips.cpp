// SPDX-License-Identifier: GPL-3.0-or-later
#include "board_chips.hpp"

#include "../../../../protocol/datagram/same_elements.hpp"

namespace r4 {
namespace sim {

namespace {

using firmware::Chip;

template <firmware::Chip of>
Drive drive_of(const Pca9685Model& chip, const firmware::DriveLines<of>& lines) {
  const int duty = chip.duty(lines.pwm);
  Drive drive;
  drive.pwm = static_cast<std::uint16_t>(duty < pwm_max ? duty : pwm_max);
  drive.direction = chip.high(lines.direction) ? Direction::forward : Direction::reverse;
  return drive;
}

bool bit(unsigned bits, int number) { return (bits >> number & 1U) != 0; }

}  // namespace

ChipPins ChipPins::safe() {
  ChipPins pins;
  for (Bldc& channel : pins.bldc) channel.brake = true;
  return pins;
}

bool ChipPins::is_safe() const { return *this == safe(); }

bool operator==(const ChipPins& a, const ChipPins& b) {
  return a.relays == b.relays && same_elements(a.osmc, b.osmc) && same_elements(a.dhb12, b.dhb12) &&
         same_elements(a.servo_us, b.servo_us) && same_elements(a.bldc, b.bldc);
}

BoardChips::BoardChips() {
  bus.attach(expander);
  bus.attach(osmc);
  bus.attach(dhb12);
  bus.attach(servo);
  bus.attach(dac);
}

void BoardChips::power_on() {
  expander.power_on();
  osmc.power_on();
  dhb12.power_on();
  servo.power_on();
  dac.power_on();
}

I2cChipModel& BoardChips::operator[](Chip chip) {
  switch (chip) {
    case Chip::osmc_pwm:
      return osmc;
    case Chip::dhb12_pwm:
      return dhb12;
    case Chip::servo_pwm:
      return servo;
    case Chip::dac:
      return dac;
    case Chip::expander:
    case Chip::count:
      break;
  }
  return expander;
}

Drive BoardChips::osmc_drive(int channel) const {
  return drive_of(osmc, firmware::osmc_lines[channel - 1]);
}

Drive BoardChips::dhb12_drive(int channel) const {
  return drive_of(dhb12, firmware::dhb12_lines[channel - 1]);
}

bool BoardChips::relay_closed(int channel) const {
  return bit(expander.level(1) & expander.driven(1), firmware::relay_bits[channel - 1]);
}

ChipPins BoardChips::pins() const {
  ChipPins pins;
  for (int i = 0; i < osmc_channels; ++i) pins.osmc[i] = osmc_drive(i + 1);
  for (int i = 0; i < dhb12_channels; ++i) pins.dhb12[i] = dhb12_drive(i + 1);
  for (int i = 0; i < servo_channels; ++i) {
    pins.servo_us[i] =
        static_cast<std::uint16_t>((servo.pulse_ns(firmware::servo_lines[i]) + 500) / 1000);
  }
  const unsigned port_a = expander.level(0) & expander.driven(0);
  for (int i = 0; i < bldc_channels; ++i) {
    const firmware::BldcLines& lines = firmware::bldc_lines[i];
    const Mcp4728Model::Setting& speed = dac.output(lines.speed);
    pins.bldc[i].speed = speed.power_down == 0 ? speed.code : std::uint16_t{0};
    pins.bldc[i].direction = bit(port_a, lines.direction) ? Direction::forward : Direction::reverse;
    pins.bldc[i].brake = bit(port_a, lines.brake);
  }
  for (int i = 0; i < relay_channels; ++i) {
    if (relay_closed(i + 1)) pins.relays = static_cast<std::uint8_t>(pins.relays | 1U << i);
  }
  return pins;
}

}  // namespace sim
}  // namespace r4
