// SPDX-License-Identifier: GPL-3.0-or-later
#include "user_i2c_controller.hpp"

namespace r4 {
namespace giga {

namespace {

constexpr std::uint32_t cr1_on = 1U << 0;
constexpr std::uint32_t cr2_read = 1U << 10;
constexpr std::uint32_t cr2_start = 1U << 13;
constexpr std::uint32_t cr2_then_stop = 1U << 25;
constexpr std::uint32_t isr_want_byte = 1U << 1;
constexpr std::uint32_t isr_byte = 1U << 2;
constexpr std::uint32_t isr_refused = 1U << 4;
constexpr std::uint32_t isr_stopped = 1U << 5;
constexpr std::uint32_t isr_complete = 1U << 6;
constexpr std::uint32_t isr_bus_error = 1U << 8;
constexpr std::uint32_t isr_lost = 1U << 9;
constexpr std::uint32_t icr_all = 0x3F38;

}  // namespace

std::uint32_t user_i2c_timing(std::uint32_t kernel_hz) {
  constexpr std::uint32_t fastest_tick_hz = 16000000;
  constexpr std::uint32_t low_ns = 5000;
  constexpr std::uint32_t high_ns = 4700;
  constexpr std::uint32_t hold_ns = 250;
  constexpr std::uint32_t setup_ns = 1250;  // 250, plus the longest rise time
  const std::uint32_t prescaler = (kernel_hz + fastest_tick_hz - 1) / fastest_tick_hz;
  const std::uint32_t tick_khz = kernel_hz / prescaler / 1000;
  const auto ticks = [tick_khz](std::uint32_t ns) { return (ns * tick_khz + 999999) / 1000000; };
  const std::uint32_t setup = ticks(setup_ns) < 16 ? ticks(setup_ns) : 16;
  return (prescaler - 1) << 28 | (setup - 1) << 20 | ticks(hold_ns) << 16 |
         (ticks(high_ns) - 1) << 8 | (ticks(low_ns) - 1);
}

UserI2cController::UserI2cController(const I2cController::Parts& parts)
    : registers_(*parts.registers), scl_(line_of(parts.scl)), sda_(line_of(parts.sda)) {
  prepare_open_drain(scl_, parts.scl_function);
  prepare_open_drain(sda_, parts.sda_function);
}

void UserI2cController::start(std::uint32_t kernel_hz) {
  registers_.CR1 = 0;
  registers_.TIMINGR = user_i2c_timing(kernel_hz);
  resume();
}

void UserI2cController::begin(const firmware::UserTransfer& transfer) {
  const InterruptLock lock;
  transfer_ = transfer;
  if (transfer.out_size != 0 || transfer.in_size == 0) {
    request(Stage::sending, transfer.out_size, transfer.in_size == 0 ? cr2_then_stop : 0);
  } else {
    request(Stage::receiving, transfer.in_size, cr2_read | cr2_then_stop);
  }
}

// START or repeated START. On a busy bus the peripheral delays it.
void UserI2cController::request(Stage stage, std::size_t size, std::uint32_t flags) {
  done_ = 0;
  registers_.ICR = icr_all;
  registers_.CR2 = std::uint32_t{transfer_.address} << 1 | static_cast<std::uint32_t>(size) << 16 |
                   flags | cr2_start;
  stage_ = stage;
}

void UserI2cController::step() {
  const std::uint32_t status = registers_.ISR;
  if ((status & (isr_bus_error | isr_lost)) != 0) {
    end(Progress::lost);
  } else if ((status & isr_refused) != 0) {  // the peripheral sends STOP by itself
    if ((status & isr_stopped) != 0) end(Progress::refused);
  } else if (stage_ == Stage::sending) {
    send_step(status);
  } else {
    receive_step(status);
  }
}

void UserI2cController::send_step(std::uint32_t status) {
  if ((status & isr_want_byte) != 0 && done_ < transfer_.out_size) {
    registers_.TXDR = transfer_.out[done_++];
  } else if ((status & isr_stopped) != 0) {
    end(done_ == transfer_.out_size ? Progress::done : Progress::lost);
  } else if ((status & isr_complete) != 0) {
    request(Stage::receiving, transfer_.in_size, cr2_read | cr2_then_stop);
  }
}

void UserI2cController::receive_step(std::uint32_t status) {
  if ((status & isr_byte) != 0 && done_ < transfer_.in_size) {
    transfer_.in[done_++] = static_cast<std::uint8_t>(registers_.RXDR);
  } else if ((status & isr_stopped) != 0) {
    end(done_ == transfer_.in_size ? Progress::done : Progress::refused);
  }
}

void UserI2cController::end(Progress result) {
  registers_.ICR = icr_all;
  if (result != Progress::done) {
    // Off for three APB clocks, so that a byte left in TXDR is not sent in the next transfer.
    registers_.CR1 = 0;
    for (int i = 0; i < 3; ++i) static_cast<void>(static_cast<std::uint32_t>(registers_.CR1));
    registers_.CR1 = cr1_on;
  }
  result_ = result;
  stage_ = Stage::idle;
}

// Drives the pins, because the peripheral does not drive a busy bus.
void UserI2cController::release() {
  const InterruptLock lock;
  stage_ = Stage::idle;
  result_ = Progress::lost;
  registers_.CR1 = 0;  // ends the transfer
  drive(true, true);
  set_mode(scl_, LineMode::output);
  set_mode(sda_, LineMode::output);
}

void UserI2cController::drive(bool scl, bool sda) {
  // SDA changes while SCL is low, except for STOP.
  if (!scl) giga::write(scl_, false);
  giga::write(sda_, sda);
  if (scl) giga::write(scl_, true);
}

void UserI2cController::resume() {
  set_mode(scl_, LineMode::alternate);
  set_mode(sda_, LineMode::alternate);
  registers_.CR1 = cr1_on;
}

}  // namespace giga
}  // namespace r4
