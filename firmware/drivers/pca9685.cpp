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

// A burst continues over a gap of at most so many unchanged registers between two groups: a new
// burst would cost as much.
constexpr int bridged = 2;

}  // namespace

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
      std::uint8_t found = 0;
      if (budget.left() < 9) return budget.take(9);
      if (!check_mode(budget) || !fetch(pre_scale, &found, 1, budget)) return false;
      if (found != prescale_) {
        fail(ChipTrouble::wrong_register);
        return false;
      }
      set_ready();
      return true;
    }
  }
  return false;
}

// The value that a register must have. False if any value will do: off needs only the full-off bit,
// on the two full bits.
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

bool Pca9685::differs(int index) const {
  std::uint8_t value = 0;
  return wanted(index, value) && value != written_[index];
}

void Pca9685::on_write_changes(BusBudget& budget) {
  if (changed_ == 0) return;
  const int step = 4 * group_;
  const unsigned group_bits = (1U << group_) - 1;
  int at = 0;
  while (at < registers) {
    int first = -1;
    int end = -1;
    for (; at < registers; at += step) {
      if ((changed_ >> at / 4 & group_bits) == 0) continue;
      int group_first = -1;
      int group_end = -1;
      for (int i = at; i < at + step; ++i) {
        if (!differs(i)) continue;
        if (group_first < 0) group_first = i;
        group_end = i + 1;
      }
      if (group_first < 0) continue;
      if (first >= 0) {
        const bool fits = static_cast<std::size_t>(group_end - first) + 2 <= budget.left();
        if (group_first - end > bridged || !fits) break;
      } else {
        first = group_first;
      }
      end = group_end;
    }
    if (first < 0) break;
    std::uint8_t bytes[1 + registers];
    std::uint8_t size = 0;
    bytes[size++] = static_cast<std::uint8_t>(led0_on_l + first);
    for (int i = first; i < end; ++i) {
      std::uint8_t value = 0;
      bytes[size++] = wanted(i, value) ? value : written_[i];
    }
    if (!send(bytes, size, budget)) return;
    std::memcpy(written_ + first, bytes + 1, static_cast<std::size_t>(end - first));
  }
  changed_ = 0;
}

bool Pca9685::check_mode(BusBudget& budget) {
  std::uint8_t mode[2] = {};
  if (!fetch(mode1, mode, sizeof mode, budget)) return false;
  if (mode[0] == mode1_running && mode[1] == mode2_totem_pole) return true;
  lost_mode_ = (mode[0] & mode1_external_clock) != 0 || mode[1] != mode2_totem_pole;
  fail((mode[0] & mode1_sleep) != 0 ? ChipTrouble::was_reset : ChipTrouble::wrong_register);
  return false;
}

void Pca9685::on_verify(BusBudget& budget) {
  if (budget.left() < 12) {
    budget.take(12);
    return;
  }
  if (!check_mode(budget)) return;
  const int first = 4 * verified_channel_;
  std::uint8_t found[4] = {};
  if (!fetch(static_cast<std::uint8_t>(led0_on_l + first), found, sizeof found, budget)) return;
  if (std::memcmp(found, written_ + first, sizeof found) != 0) fail(ChipTrouble::wrong_register);
  verified_channel_ = static_cast<std::uint8_t>((verified_channel_ + 1) % channels);
}

}  // namespace firmware
}  // namespace r4
