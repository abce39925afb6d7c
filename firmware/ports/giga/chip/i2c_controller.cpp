// SPDX-License-Identifier: GPL-3.0-or-later
#include "i2c_controller.hpp"

namespace r4 {
namespace giga {

using firmware::I2cResult;

namespace {

constexpr std::uint32_t cr1_on = 1U << 0;  // PE; off releases the lines and ends the transfer
constexpr std::uint32_t cr2_read = 1U << 10;
constexpr std::uint32_t cr2_start = 1U << 13;
constexpr std::uint32_t cr2_then_stop = 1U << 25;  // AUTOEND
constexpr std::uint32_t isr_want_byte = 1U << 1;   // TXIS
constexpr std::uint32_t isr_byte = 1U << 2;        // RXNE
constexpr std::uint32_t isr_refused = 1U << 4;     // NACKF
constexpr std::uint32_t isr_stopped = 1U << 5;     // STOPF
constexpr std::uint32_t isr_complete = 1U << 6;    // TC
constexpr std::uint32_t isr_bus_error = 1U << 8;   // BERR
constexpr std::uint32_t isr_lost = 1U << 9;        // ARLO: another device pulls SDA down
constexpr std::uint32_t isr_busy = 1U << 15;
constexpr std::uint32_t icr_all = 0x3F38;

constexpr std::uint32_t cr2_for(std::uint8_t address, std::size_t size) {
  return std::uint32_t{address} << 1 | static_cast<std::uint32_t>(size) << 16;
}

// For recovery: half a clock at 100 kHz, and the longest stretch by a chip.
constexpr std::uint32_t half_clock_us = 5;
constexpr std::uint32_t stretch_us = 20;
constexpr int recovery_clocks = 9;
// A wait ends at most 1 us late.
static_assert((stretch_us + half_clock_us + 2) +
                      (recovery_clocks + 1) * (stretch_us + 3 * half_clock_us + 4) <=
                  firmware::i2c_recovery_us,
              "a recovery takes longer than promised");

}  // namespace

std::uint32_t i2c_timing(std::uint32_t kernel_hz) {
  constexpr std::uint32_t fastest_tick_hz = 16000000;
  constexpr std::uint32_t low_ns = 1500;
  constexpr std::uint32_t high_ns = 1000;
  constexpr std::uint32_t hold_ns = 250;
  constexpr std::uint32_t setup_ns = 400;
  const std::uint32_t prescaler = (kernel_hz + fastest_tick_hz - 1) / fastest_tick_hz;
  const std::uint32_t tick_khz = kernel_hz / prescaler / 1000;
  const auto ticks = [tick_khz](std::uint32_t ns) { return (ns * tick_khz + 999999) / 1000000; };
  return (prescaler - 1) << 28 | (ticks(setup_ns) - 1) << 20 | ticks(hold_ns) << 16 |
         (ticks(high_ns) - 1) << 8 | (ticks(low_ns) - 1);
}

I2cController::I2cController(const Parts& parts, Clock clock)
    : registers_(*parts.registers),
      scl_(line_of(parts.scl)),
      sda_(line_of(parts.sda)),
      clock_(clock) {
  prepare_open_drain(scl_, parts.scl_function);
  prepare_open_drain(sda_, parts.sda_function);
}

void I2cController::start(std::uint32_t kernel_hz) {
  registers_.CR1 = 0;
  registers_.TIMINGR = i2c_timing(kernel_hz);
  set_mode(scl_, LineMode::alternate);
  set_mode(sda_, LineMode::alternate);
  registers_.CR1 = cr1_on;
}

// If another transfer took over the bus, no second attempt follows: it could undo that transfer.
template <class Attempt>
I2cResult I2cController::transfer(std::size_t bytes, std::size_t starts, Attempt attempt) {
  constexpr std::uint32_t clean_up_us = 20;
  if (under_way_) recover();
  under_way_ = true;
  Transfer transfer;
  transfer.recovery = recoveries_;
  transfer.limit_us =
      firmware::i2c_wire_us(bytes, starts) + firmware::i2c_timeout_us / attempts - clean_up_us;
  I2cResult result = I2cResult::timeout;
  for (int i = 0; i < attempts && result == I2cResult::timeout; ++i) {
    if (i > 0 && transfer.recovery == recoveries_) free_lines();
    transfer.began_us = clock_();
    result = wait_until_free(transfer);  // a timeout at once if the bus was taken over
    if (result == I2cResult::ok) result = attempt(transfer);
    result = finish(transfer, result);
  }
  under_way_ = false;
  return result;
}

bool I2cController::alive(const Transfer& transfer) const {
  return transfer.recovery == recoveries_ && clock_() - transfer.began_us < transfer.limit_us;
}

// If another transfer has taken over the bus, request() and put() do nothing and return false: a
// START or a byte would disturb that transfer.
bool I2cController::request(const Transfer& transfer, std::uint32_t cr2) {
  const InterruptLock lock;
  if (transfer.recovery != recoveries_) return false;
  registers_.ICR = icr_all;
  registers_.CR2 = cr2 | cr2_start;
  return true;
}

bool I2cController::put(const Transfer& transfer, std::uint8_t byte) {
  const InterruptLock lock;
  if (transfer.recovery != recoveries_) return false;
  registers_.TXDR = byte;
  return true;
}

I2cResult I2cController::wait_until_free(const Transfer& transfer) {
  while ((registers_.ISR & isr_busy) != 0) {
    if (!alive(transfer)) return I2cResult::timeout;
  }
  return alive(transfer) ? I2cResult::ok : I2cResult::timeout;
}

I2cResult I2cController::send(const Transfer& transfer, std::uint8_t address,
                              const std::uint8_t* bytes, std::size_t size, bool then_stop) {
  if (!request(transfer, cr2_for(address, size) | (then_stop ? cr2_then_stop : 0))) {
    return I2cResult::timeout;
  }
  std::size_t sent = 0;
  const std::uint32_t end = then_stop ? isr_stopped : isr_complete;
  for (;;) {
    const std::uint32_t status = registers_.ISR;
    if ((status & isr_lost) != 0) return I2cResult::timeout;
    if ((status & isr_refused) != 0) {  // the peripheral sends STOP by itself
      if ((status & isr_stopped) != 0) return I2cResult::no_acknowledge;
    } else if ((status & end) != 0) {
      return sent == size ? I2cResult::ok : I2cResult::timeout;
    } else if ((status & isr_want_byte) != 0 && sent < size) {
      if (!put(transfer, bytes[sent])) return I2cResult::timeout;
      ++sent;
    }
    if (!alive(transfer)) return I2cResult::timeout;
  }
}

I2cResult I2cController::receive(const Transfer& transfer, std::uint8_t address,
                                 std::uint8_t* bytes, std::size_t size) {
  if (!request(transfer, cr2_for(address, size) | cr2_read | cr2_then_stop)) {
    return I2cResult::timeout;
  }
  std::size_t received = 0;
  for (;;) {
    const std::uint32_t status = registers_.ISR;
    if ((status & isr_lost) != 0) return I2cResult::timeout;
    if ((status & isr_byte) != 0 && received < size) {
      bytes[received++] = static_cast<std::uint8_t>(registers_.RXDR);
    } else if ((status & isr_stopped) != 0) {
      if ((status & isr_bus_error) != 0) return I2cResult::timeout;
      return received == size ? I2cResult::ok : I2cResult::no_acknowledge;
    }
    if (!alive(transfer)) return I2cResult::timeout;
  }
}

I2cResult I2cController::finish(const Transfer& transfer, I2cResult result) {
  const InterruptLock lock;
  if (transfer.recovery != recoveries_) return I2cResult::timeout;
  registers_.ICR = icr_all;
  if (result != I2cResult::ok) restart();
  return result;
}

// Software reset. Deletes a byte left in TXDR, which the next transfer would otherwise send first.
void I2cController::restart() {
  registers_.CR1 = 0;
  for (int i = 0; i < 3; ++i) {  // PE must be low for three APB clocks
    static_cast<void>(static_cast<std::uint32_t>(registers_.CR1));
  }
  registers_.CR1 = cr1_on;
}

I2cResult I2cController::write(std::uint8_t address, const std::uint8_t* bytes, std::size_t size) {
  if (size > max_size) return I2cResult::no_acknowledge;
  return transfer(1 + size, 1, [&](const Transfer& transfer) {
    return send(transfer, address, bytes, size, true);
  });
}

I2cResult I2cController::write_read(std::uint8_t address, const std::uint8_t* out,
                                    std::size_t out_size, std::uint8_t* in, std::size_t in_size) {
  if (out_size > max_size || in_size > max_size) return I2cResult::no_acknowledge;
  if (in_size == 0) return write(address, out, out_size);
  return transfer(2 + out_size + in_size, 2, [&](const Transfer& transfer) {
    const I2cResult result =
        out_size == 0 ? I2cResult::ok : send(transfer, address, out, out_size, false);
    return result == I2cResult::ok ? receive(transfer, address, in, in_size) : result;
  });
}

void I2cController::pause_us(std::uint32_t us) const {
  const std::uint32_t began_us = clock_();
  while (clock_() - began_us <= us) {
  }
}

bool I2cController::release_scl() {
  giga::write(scl_, true);
  const std::uint32_t began_us = clock_();
  while (!read(scl_)) {
    if (clock_() - began_us > stretch_us) return false;
  }
  pause_us(half_clock_us);
  return true;
}

bool I2cController::recover() {
  recoveries_ = recoveries_ + 1;
  return free_lines();
}

// Drives the pins, because the peripheral does not drive a busy bus. Clocks SCL only while SDA is
// held (UM10204 3.1.16), because a chip that was being written to would read a clock as a bit. If a
// recovery interrupts this function, the remaining steps of this function send at most a START and
// a STOP on a free bus.
bool I2cController::free_lines() {
  registers_.CR1 = 0;
  giga::write(scl_, true);
  giga::write(sda_, true);
  set_mode(scl_, LineMode::output);
  set_mode(sda_, LineMode::output);
  bool released = release_scl();
  bool stopped = false;
  for (int clocks = 0; released && !stopped && clocks <= recovery_clocks; ++clocks) {
    const bool held = !read(sda_);
    giga::write(scl_, false);
    if (!held) giga::write(sda_, false);
    pause_us(half_clock_us);
    released = release_scl();
    if (held) continue;
    giga::write(sda_, true);
    pause_us(half_clock_us);
    stopped = read(sda_);  // a chip that was being read may have put a bit there
  }
  const bool free = stopped && released && read(scl_);
  set_mode(scl_, LineMode::alternate);
  set_mode(sda_, LineMode::alternate);
  registers_.CR1 = cr1_on;
  return free;
}

}  // namespace giga
}  // namespace r4
