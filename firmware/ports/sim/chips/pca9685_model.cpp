// SPDX-License-Identifier: GPL-3.0-or-later
#include "pca9685_model.hpp"

#include <algorithm>
#include <cstddef>
#include <iterator>

namespace r4 {
namespace sim {

namespace {

constexpr std::uint8_t mode1 = 0x00;
constexpr std::uint8_t mode2 = 0x01;
constexpr std::uint8_t sub_address_1 = 0x02;
constexpr std::uint8_t all_call_address = 0x05;
constexpr std::uint8_t led_first = 0x06;
constexpr std::uint8_t led_last = 0x45;
constexpr std::uint8_t all_led_first = 0xFA;
constexpr std::uint8_t all_led_last = 0xFD;
constexpr std::uint8_t pre_scale = 0xFE;
constexpr std::uint8_t test_mode = 0xFF;

constexpr std::uint8_t restart = 0x80;
constexpr std::uint8_t external_clock = 0x40;
constexpr std::uint8_t auto_increment = 0x20;
constexpr std::uint8_t sleep = 0x10;
constexpr std::uint8_t all_call = 0x01;
constexpr std::uint8_t inverted = 0x10;
constexpr std::uint8_t change_on_acknowledge = 0x08;
constexpr std::uint8_t full = 0x10;

constexpr std::uint64_t start_up_ns = 500'000;

}  // namespace

void Pca9685Model::power_on() {
  for (std::uint8_t& value : registers_) value = 0;
  registers_[mode1] = sleep | all_call;
  registers_[mode2] = 0x04;
  registers_[sub_address_1] = 0xE2;
  registers_[sub_address_1 + 1] = 0xE4;
  registers_[sub_address_1 + 2] = 0xE8;
  registers_[all_call_address] = 0xE0;
  for (std::size_t i = led_first + 3; i <= led_last; i += 4) registers_[i] = full;
  registers_[pre_scale] = 0x1E;
  show();
  pointer_ = 0;
  phase_ = Phase::idle;
  led_written_ = false;
  restart_wanted_ = false;
}

bool Pca9685Model::start(std::uint8_t address, bool read) {
  const std::uint8_t modes = registers_[mode1];
  const auto is = [&](std::uint8_t number) { return registers_[number] >> 1 == address; };
  if (address == 0) {  // software reset, section 7.6
    phase_ = Phase::general_call;
    return !read;
  }
  // The shared addresses are acknowledged by reads, too (7.1.2, 7.1.3).
  bool mine = address == address_ || ((modes & all_call) != 0 && is(all_call_address));
  for (int i = 0; i < 3; ++i) {  // SUB1 is bit 3, SUB3 bit 1
    mine =
        mine || ((modes >> (3 - i) & 1) != 0 && is(static_cast<std::uint8_t>(sub_address_1 + i)));
  }
  phase_ = !mine ? Phase::idle : read ? Phase::data : Phase::control;
  return mine;
}

bool Pca9685Model::write(std::uint8_t byte) {
  switch (phase_) {
    case Phase::idle:
    case Phase::reset_wanted:  // one byte more: no reset
      phase_ = Phase::idle;
      return false;
    case Phase::general_call:
      phase_ = byte == 0x06 ? Phase::reset_wanted : Phase::idle;
      return byte == 0x06;
    case Phase::control:
      if (byte > led_last && byte < all_led_first) {  // reserved
        phase_ = Phase::idle;
        return false;
      }
      pointer_ = byte;
      phase_ = Phase::data;
      return true;
    case Phase::data:
      write_register(byte);
      next_register();
      return true;
  }
  return false;
}

std::uint8_t Pca9685Model::read() {
  std::uint8_t value = registers_[pointer_];
  if (pointer_ == mode1 && restart_wanted_) value |= restart;
  next_register();
  return value;
}

void Pca9685Model::stop() {
  if (phase_ == Phase::reset_wanted) {
    power_on();
    return;
  }
  phase_ = Phase::idle;
  if (!led_written_) return;
  led_written_ = false;
  show();
  restart_wanted_ = false;  // section 7.3.1.1, 3
}

void Pca9685Model::next_register() {
  if ((registers_[mode1] & auto_increment) == 0) return;
  if (pointer_ == led_last || pointer_ == pre_scale) {
    pointer_ = 0;
  } else if (pointer_ != test_mode) {
    ++pointer_;
  }
}

void Pca9685Model::write_register(std::uint8_t value) {
  if (pointer_ == mode1) {
    write_mode1(value);
  } else if (pointer_ == mode2) {
    registers_[mode2] = value & 0x1F;
  } else if (pointer_ < led_first) {
    registers_[pointer_] = value & 0xFE;
  } else if (pointer_ <= led_last) {
    registers_[pointer_] = (pointer_ - led_first) % 2 == 0 ? value : value & 0x1F;
    led_written_ = true;
  } else if (pointer_ >= all_led_first && pointer_ <= all_led_last) {
    const std::size_t offset = static_cast<std::size_t>(pointer_ - all_led_first);
    for (std::size_t i = led_first + offset; i <= led_last; i += 4) {
      registers_[i] = offset % 2 == 0 ? value : value & 0x1F;
    }
    led_written_ = true;
  } else if (pointer_ == pre_scale && (registers_[mode1] & sleep) != 0) {
    registers_[pre_scale] = std::max<std::uint8_t>(value, 3);
  }
  if (led_written_ && (registers_[mode2] & change_on_acknowledge) != 0) show();
}

void Pca9685Model::write_mode1(std::uint8_t value) {
  const std::uint8_t before = registers_[mode1];
  const bool was_asleep = (before & sleep) != 0;
  std::uint8_t after = value & static_cast<std::uint8_t>(~restart & ~external_clock);
  after |= before & external_clock;  // set only while asleep, cleared only by a reset
  if (was_asleep && (value & sleep) != 0) after |= value & external_clock;
  if ((value & sleep) != 0 && !was_asleep) {
    // Channels without an orderly shutdown wait for RESTART.
    for (std::size_t i = led_first + 3; i <= led_last; i += 4) {
      if ((registers_[i] & full) == 0) restart_wanted_ = true;
    }
  }
  if ((value & sleep) == 0 && was_asleep) awake_since_ns_ = now_ns();
  registers_[mode1] = after;
  if ((value & restart) != 0 && (value & sleep) == 0 && now_ns() - awake_since_ns_ >= start_up_ns) {
    restart_wanted_ = false;
  }
}

bool Pca9685Model::clock_stands() const { return (registers_[mode1] & external_clock) != 0; }

void Pca9685Model::show() {
  if (clock_stands()) return;
  std::copy_n(registers_ + led_first, std::end(active_) - std::begin(active_), active_);
}

bool Pca9685Model::running() const {
  return (registers_[mode1] & sleep) == 0 && now_ns() - awake_since_ns_ >= start_up_ns &&
         !restart_wanted_;
}

int Pca9685Model::duty(int channel) const {
  const std::uint8_t* led = &active_[4 * channel];
  int duty = 0;
  if ((!running() && !clock_stands()) || (led[3] & full) != 0) {
    duty = 0;
  } else if ((led[1] & full) != 0 || clock_stands()) {
    duty = 4096;
  } else {
    const int on = led[0] | (led[1] & 0x0F) << 8;
    const int off = led[2] | (led[3] & 0x0F) << 8;
    duty = (off - on + 4096) % 4096;
  }
  return (registers_[mode2] & inverted) != 0 ? 4096 - duty : duty;
}

}  // namespace sim
}  // namespace r4
