// SPDX-License-Identifier: GPL-3.0-or-later
#include "pca9685.hpp"

#include <cstring>

namespace r4 {
namespace firmware {

namespace {

constexpr std::uint8_t mode1 = 0x00;
constexpr std::uint8_t led0_on_l = 0x06;
constexpr std::uint8_t all_led_on_l = 0xFA;
constexpr std::uint8_t all_led_off_h = 0xFD;
constexpr std::uint8_t pre_scale = 0xFE;

constexpr std::uint8_t mode1_restart = 0x80;
constexpr std::uint8_t mode1_external_clock = 0x40;
constexpr std::uint8_t mode1_auto_increment = 0x20;
constexpr std::uint8_t mode1_sleep = 0x10;
constexpr std::uint8_t mode1_all_call = 0x01;
constexpr std::uint8_t mode1_running = mode1_auto_increment | mode1_all_call;
constexpr std::uint8_t mode2_totem_pole = 0x04;
constexpr std::uint8_t full = 0x10;  // full on in ON_H, full off in OFF_H

constexpr int on_h = 1;
constexpr int off_l = 2;
constexpr int off_h = 3;

// At most this many unchanged registers in a burst: over a longer gap a new burst takes less time.
constexpr int bridged = 2;

}  // namespace

Pca9685::Pca9685(I2cBus& bus, std::uint8_t address, std::uint32_t frequency_hz)
    : ChipDriver(bus, address), prescale_(prescale_for(frequency_hz)) {
  for (std::uint8_t i = 0; i < channels; ++i) partner_[i] = i;
}

void Pca9685::pair(int a, int b) {
  partner_[a] = static_cast<std::uint8_t>(b);
  partner_[b] = static_cast<std::uint8_t>(a);
}

void Pca9685::set_duty(int channel, std::uint16_t duty) {
  if (duty > duty_on) duty = duty_on;
  if (duty_[channel] == duty) return;
  duty_[channel] = duty;
  changed_ = static_cast<std::uint16_t>(changed_ | 1U << channel);
}

void Pca9685::set_pulse_us(int channel, std::uint16_t us) {
  const std::uint32_t count_in_25ths = prescale_ + 1U;
  std::uint32_t counts = (us * 25U + count_in_25ths / 2) / count_in_25ths;
  if (counts > duty_on) counts = duty_on;
  set_duty(channel, static_cast<std::uint16_t>(counts));
}

void Pca9685::want_safe() {
  for (std::uint16_t& duty : duty_) duty = 0;
  changed_ = all_channels;
}

I2cResult Pca9685::all_off(I2cBus& bus) {
  const std::uint8_t bytes[] = {all_led_off_h, full};
  return bus.write(all_call_address, bytes, sizeof bytes);
}

I2cResult Pca9685::reset_all(I2cBus& bus) {
  constexpr std::uint8_t general_call = 0;
  constexpr std::uint8_t reset = 0x06;
  return bus.write(general_call, &reset, 1);
}

I2cResult Pca9685::make_safe() {
  want_safe();
  const std::uint8_t bytes[] = {all_led_off_h, full};
  const I2cResult result = bus_.write(address(), bytes, sizeof bytes);
  if (result == I2cResult::ok) {
    for (int i = off_h; i < registers; i += 4) written_[i] = full;
  }
  return result;
}

void Pca9685::on_begin() {
  step_ = Step::off;
  lost_mode_ = false;
}

bool Pca9685::set_up(std::uint32_t now_us, BusBudget& budget) {
  switch (step_) {
    case Step::off: {
      const std::uint8_t bytes[] = {all_led_off_h, full};
      if (!send(bytes, sizeof bytes, budget)) return false;
      step_ = Step::sleep;
      return true;
    }
    case Step::sleep: {
      const std::uint8_t bytes[] = {mode1, mode1_running | mode1_sleep, mode2_totem_pole};
      if (!send(bytes, sizeof bytes, budget)) return false;
      step_ = Step::prescale;
      return true;
    }
    case Step::prescale: {
      const std::uint8_t bytes[] = {pre_scale, prescale_};
      if (!send(bytes, sizeof bytes, budget)) return false;
      step_ = Step::wake;
      return true;
    }
    case Step::wake: {
      const std::uint8_t bytes[] = {mode1, mode1_running};
      if (!send(bytes, sizeof bytes, budget)) return false;
      awake_us_ = now_us;
      step_ = Step::restart;
      return true;
    }
    case Step::restart: {
      if (now_us - awake_us_ < wake_wait_us) return false;
      const std::uint8_t bytes[] = {mode1, mode1_running | mode1_restart};
      if (!send(bytes, sizeof bytes, budget)) return false;
      step_ = Step::clear;
      return true;
    }
    case Step::clear: {
      const std::uint8_t bytes[] = {all_led_on_l, 0, 0, 0, full};
      if (!send(bytes, sizeof bytes, budget)) return false;
      for (int i = 0; i < registers; ++i) written_[i] = i % 4 == off_h ? full : 0;
      step_ = Step::check;
      return true;
    }
    case Step::check: {
      if (budget.left() < 9) return budget.take(9);
      if (!check_mode(budget) || !check_frequency(budget)) return false;
      set_ready();
      return true;
    }
  }
  return false;
}

// False if any value is right: off needs only the full-off bit, on needs both full bits.
bool Pca9685::wanted(int index, std::uint8_t& value) const {
  const std::uint16_t duty = duty_[index / 4];
  const int offset = index % 4;
  if (duty == 0) {
    value = full;
    return offset == off_h;
  }
  if (duty == duty_on) {
    value = offset == on_h ? full : 0;
    return offset == on_h || offset == off_h;
  }
  value = 0;
  if (offset == off_l) value = static_cast<std::uint8_t>(duty & 0xFF);
  if (offset == off_h) value = static_cast<std::uint8_t>(duty >> 8);
  return true;
}

// The registers from `first` to `end` - 1; none if `end` is 0.
struct Pca9685::Registers {
  int first = registers;
  int end = 0;
  bool any() const { return end != 0; }
  void take(int index) {
    if (index < first) first = index;
    if (index >= end) end = index + 1;
  }
};

void Pca9685::take_differing(int channel, Registers& found) const {
  for (int i = 4 * channel; i < 4 * channel + 4; ++i) {
    std::uint8_t value = 0;
    if (wanted(i, value) && value != written_[i]) found.take(i);
  }
}

// Collects changed channels and partners while their registers are near and fit into `most` bytes.
std::uint16_t Pca9685::next_burst(std::size_t most, Registers& burst) {
  std::uint16_t taken = 0;
  for (int i = 0; changed_ >> i != 0; ++i) {
    if (((changed_ & ~taken) >> i & 1) == 0) continue;
    const auto both = static_cast<std::uint16_t>(1U << i | 1U << partner_[i]);
    Registers differing;
    take_differing(i, differing);
    if (partner_[i] != i) take_differing(partner_[i], differing);
    if (differing.any()) {
      Registers longer = burst;
      longer.take(differing.first);
      longer.take(differing.end - 1);
      const bool fits = static_cast<std::size_t>(longer.end - longer.first) + 2 <= most;
      if (burst.any() && (differing.first - burst.end > bridged || !fits)) break;
      burst = longer;
    }
    taken = static_cast<std::uint16_t>(taken | both);
  }
  return taken;
}

// A burst may include a channel that waits for a later burst. Its registers keep their values.
void Pca9685::on_write_changes(BusBudget& budget) {
  while (changed_ != 0) {
    Registers burst;
    const std::uint16_t taken = next_burst(budget.left(), burst);
    if (burst.any()) {
      std::uint8_t bytes[1 + registers];
      std::uint8_t size = 0;
      bytes[size++] = static_cast<std::uint8_t>(led0_on_l + burst.first);
      for (int i = burst.first; i < burst.end; ++i) {
        std::uint8_t value = 0;
        const bool changes = (taken >> i / 4 & 1) != 0 && wanted(i, value);
        bytes[size++] = changes ? value : written_[i];
      }
      if (!send(bytes, size, budget)) return;
      std::memcpy(written_ + burst.first, bytes + 1, size - std::size_t{1});
    }
    changed_ = static_cast<std::uint16_t>(changed_ & ~taken);
  }
}

bool Pca9685::check_mode(BusBudget& budget) {
  std::uint8_t mode[2] = {};
  if (!fetch(mode1, mode, sizeof mode, budget)) return false;
  if (mode[0] == mode1_running && mode[1] == mode2_totem_pole) return true;
  lost_mode_ = (mode[0] & mode1_external_clock) != 0 || mode[1] != mode2_totem_pole;
  fail((mode[0] & mode1_sleep) != 0 ? ChipTrouble::was_reset : ChipTrouble::wrong_register);
  return false;
}

bool Pca9685::check_frequency(BusBudget& budget) {
  std::uint8_t found = 0;
  if (!fetch(pre_scale, &found, 1, budget)) return false;
  if (found == prescale_) return true;
  fail(ChipTrouble::wrong_register);
  return false;
}

void Pca9685::on_verify(BusBudget& budget) {
  if (budget.left() < 16) {
    budget.take(16);
    return;
  }
  if (!check_mode(budget) || !check_frequency(budget)) return;
  const int first = 4 * verified_channel_;
  std::uint8_t found[4] = {};
  if (!fetch(static_cast<std::uint8_t>(led0_on_l + first), found, sizeof found, budget)) return;
  if (std::memcmp(found, written_ + first, sizeof found) != 0) fail(ChipTrouble::wrong_register);
  verified_channel_ = static_cast<std::uint8_t>((verified_channel_ + 1) % channels);
}

}  // namespace firmware
}  // namespace r4
