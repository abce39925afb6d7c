// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/registers.hpp"
#include "fake_giga.hpp"

namespace r4::fake {

namespace {

constexpr std::uint32_t txis = 1U << 1;
constexpr std::uint32_t rxne = 1U << 2;
constexpr std::uint32_t nackf = 1U << 4;
constexpr std::uint32_t stopf = 1U << 5;
constexpr std::uint32_t tc = 1U << 6;
constexpr std::uint32_t berr = 1U << 8;
constexpr std::uint32_t arlo = 1U << 9;
constexpr std::uint32_t busy = 1U << 15;
constexpr std::uint32_t cr2_read = 1U << 10;
constexpr std::uint32_t cr2_start = 1U << 13;
constexpr std::uint32_t cr2_autoend = 1U << 25;

}  // namespace

void I2cPeripheral::connect(I2C_TypeDef& registers, std::vector<sim::I2cChipModel*> chips,
                            std::uint64_t clock_ns) {
  registers_ = &registers;
  chips_ = std::move(chips);
  byte_ns = 9 * clock_ns;
  stop_ns = clock_ns;
  step_ = Step::idle;
  flags_ = 0;
  taking_part_.clear();
  registers_->CR1.on_write = [this](std::uint32_t value) {
    registers_->CR1.value = value;
    if ((value & 1U) != 0) return;
    cut_off_chips();
    flags_ = 0;
    txdr_.reset();
  };
  registers_->CR2.on_write = [this](std::uint32_t value) {
    if ((value & cr2_start) != 0 && (registers_->CR1.value & 1U) != 0) start(value);
  };
  registers_->ISR.on_read = [this] {
    progress();
    const bool held = sda_held_ > 0 || scl_held_;
    return flags_ | (step_ != Step::idle || held ? busy : 0U);
  };
  registers_->ICR.on_write = [this](std::uint32_t value) { flags_ &= ~value; };
  registers_->TXDR.on_write = [this](std::uint32_t value) {
    if ((flags_ & txis) == 0) return;
    txdr_ = static_cast<std::uint8_t>(value);
    flags_ &= ~txis;
    if (step_ == Step::want_byte) shift();
  };
  registers_->RXDR.on_read = [this] {
    flags_ &= ~rxne;
    if (--left_ == 0) {
      after(Step::stop, stop_ns);
    } else {
      after(Step::read, byte_ns);
    }
    return in_;
  };
}

void I2cPeripheral::after(Step step, std::uint64_t ns) {
  step_ = step;
  due_ns_ = giga().now_ns() + ns;
}

void I2cPeripheral::start(std::uint32_t cr2) {
  cr2_ = cr2;
  left_ = cr2 >> 16 & 0xFF;
  flags_ = 0;
  sent_ = 0;
  if (sda_held_ > 0 || scl_held_) {
    step_ = Step::stuck;
    return;
  }
  after(Step::address, byte_ns + stop_ns);
}

void I2cPeripheral::count_byte() {
  if (bus_error_after_ >= 0 && bus_error_after_-- == 0) flags_ |= berr;
  if (disturbed_after_ >= 0 && disturbed_after_-- == 0) {
    flags_ |= berr;
    stop_chips();
  }
  if (hold_after_ < 0) return;
  if (hold_after_-- > 0) return;
  sda_held_ = hold_clocks_;
  hold_after_ = -1;
}

void I2cPeripheral::stop_chips() {
  for (sim::I2cChipModel* chip : taking_part_) chip->stop();
  taking_part_.clear();
}

void I2cPeripheral::cut_off_chips() {
  const bool in_byte = step_ == Step::read && (flags_ & rxne) == 0 && !taking_part_.empty();
  if (in_byte) sda_held_ = 9;
  step_ = Step::idle;
  taking_part_.clear();
}

// Moves the byte in TXDR to the wire, which makes room for the next byte (RM0399, chapter I2C,
// "Master transmitter"). If a chip refuses the byte, the next byte stays in TXDR until the
// peripheral is off.
void I2cPeripheral::shift() {
  out_ = *txdr_;
  txdr_.reset();
  if (left_ > 1) flags_ |= txis;
  after(Step::byte, byte_ns);
}

void I2cPeripheral::refuse() {
  flags_ &= ~txis;
  flags_ |= nackf;
  after(Step::stop, stop_ns);
}

void I2cPeripheral::end_of_bytes() {
  if ((cr2_ & cr2_autoend) != 0) {
    after(Step::stop, stop_ns);
  } else {
    step_ = Step::complete;
    flags_ |= tc;
  }
}

void I2cPeripheral::progress() {
  if (sda_held_ > 0 && step_ != Step::idle) step_ = Step::stuck;
  if (giga().now_ns() < due_ns_) return;
  if (losses_ > 0 && step_ != Step::idle && sent_++ == lose_after_) {
    --losses_;
    cut_off_chips();
    flags_ |= arlo;
    return;
  }
  const bool reading = (cr2_ & cr2_read) != 0;
  switch (step_) {
    case Step::address: {
      const auto address = static_cast<std::uint8_t>(cr2_ >> 1 & 0x7F);
      log.push_back({static_cast<std::uint8_t>(address << 1 | (reading ? 1 : 0))});
      taking_part_.clear();
      for (sim::I2cChipModel* chip : chips_) {
        if (chip->start(address, reading)) taking_part_.push_back(chip);
      }
      count_byte();
      if (taking_part_.empty()) {
        refuse();
      } else if (left_ == 0) {
        end_of_bytes();
      } else if (reading) {
        after(Step::read, byte_ns);
      } else if (txdr_) {
        shift();
      } else {
        step_ = Step::want_byte;
        flags_ |= txis;
      }
      return;
    }
    case Step::byte: {
      log.back().push_back(out_);
      count_byte();
      bool acknowledged = false;
      for (sim::I2cChipModel* chip : taking_part_) acknowledged |= chip->write(out_);
      if (refuse_after_ >= 0 && refuse_after_-- == 0) acknowledged = false;
      --left_;
      if (!acknowledged) {
        refuse();
      } else if (left_ == 0) {
        end_of_bytes();
      } else if (txdr_) {
        shift();
      } else {
        step_ = Step::want_byte;
      }
      return;
    }
    case Step::read:
      if ((flags_ & rxne) != 0) return;
      in_ = taking_part_.empty() ? 0xFF : taking_part_.front()->read();
      count_byte();
      flags_ |= rxne;
      return;
    case Step::stop:
      stop_chips();
      flags_ |= stopf;
      step_ = Step::idle;
      return;
    case Step::idle:
    case Step::want_byte:
    case Step::complete:
    case Step::stuck:
      return;
  }
}

}  // namespace r4::fake
