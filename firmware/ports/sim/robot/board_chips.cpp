// SPDX-License-Identifier: GPL-3.0-or-later
#include "board_chips.hpp"

#include "../../../../protocol/datagram/same_elements.hpp"

namespace r4 {
namespace sim {

namespace {

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

BoardChips::BoardChips(const Wiring& wired)
    : wiring(wired),
      expander(wired.chip(Chip::expander).number()),
      osmc(wired.chip(Chip::osmc_pwm).number()),
      dhb12(wired.chip(Chip::dhb12_pwm).number()),
      servo(wired.chip(Chip::servo_pwm).number()),
      dac(wired.chip(Chip::dac).number()) {
  for (int i = 0; i < chip_count; ++i) {
    const Chip chip = static_cast<Chip>(i);
    if (wiring.chip(chip).connected()) bus.attach((*this)[chip]);
  }
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

// With both lines low the motor is off, and the direction is the direction of a safe output.
Drive BoardChips::drive(SignalKind pwm, SignalKind direction, int channel) const {
  const Place first = wiring.at(pwm, channel);
  const Place second = wiring.at(direction, channel);
  Drive drive;
  if (!first.connected() || !second.connected()) return drive;
  const Pca9685Model& chip = first.number() < pca9685_lines ? osmc : dhb12;
  const int duty = chip.duty(first.number() % pca9685_lines);
  const int second_duty = chip.duty(second.number() % pca9685_lines);
  if (duty == 0 && second_duty == 0) return drive;
  const bool two_pwm = first.option();
  const int difference = two_pwm ? duty - second_duty : duty;
  const int size = difference < 0 ? -difference : difference;
  const bool forward = two_pwm ? difference > 0 : second_duty != 0;
  drive.pwm = static_cast<std::uint16_t>(size < pwm_max ? size : pwm_max);
  drive.direction = forward != second.option() ? Direction::forward : Direction::reverse;
  return drive;
}

Drive BoardChips::osmc_drive(int channel) const {
  return drive(SignalKind::osmc_pwm, SignalKind::osmc_direction, channel);
}

Drive BoardChips::dhb12_drive(int channel) const {
  return drive(SignalKind::dhb12_pwm, SignalKind::dhb12_direction, channel);
}

bool BoardChips::is_driven(SignalKind kind, int channel) const {
  const Place place = wiring.at(kind, channel);
  if (!place.connected()) return false;
  const int port = place.number() / 8;
  const int number = place.number() % 8;
  return bit(expander.driven(port), number) && bit(expander.level(port), number) != place.option();
}

bool BoardChips::relay_closed(int channel) const { return is_driven(SignalKind::relay, channel); }

ChipPins BoardChips::pins() const {
  ChipPins pins;
  for (int i = 0; i < osmc_channels; ++i) pins.osmc[i] = osmc_drive(i + 1);
  for (int i = 0; i < dhb12_channels; ++i) pins.dhb12[i] = dhb12_drive(i + 1);
  for (int i = 0; i < servo_channels; ++i) {
    const Place line = wiring.at(SignalKind::servo, i + 1);
    if (!line.connected()) continue;
    const std::uint64_t ns = servo.pulse_ns(line.number() % pca9685_lines);
    pins.servo_us[i] = static_cast<std::uint16_t>((ns + 500) / 1000);
  }
  for (int i = 0; i < bldc_channels; ++i) {
    const Place output = wiring.at(SignalKind::bldc_speed, i + 1);
    Bldc& bldc = pins.bldc[i];
    if (output.connected()) {
      const Mcp4728Model::Setting& speed = dac.output(output.number());
      bldc.speed = speed.power_down == 0 ? speed.code : std::uint16_t{0};
    }
    const bool forward = is_driven(SignalKind::bldc_direction, i + 1);
    bldc.direction = forward ? Direction::forward : Direction::reverse;
    const bool has_brake = wiring.at(SignalKind::bldc_brake, i + 1).connected();
    bldc.brake = has_brake ? is_driven(SignalKind::bldc_brake, i + 1) : bldc.speed == 0;
  }
  for (int i = 0; i < relay_channels; ++i) {
    if (relay_closed(i + 1)) pins.relays = static_cast<std::uint8_t>(pins.relays | 1U << i);
  }
  return pins;
}

}  // namespace sim
}  // namespace r4
