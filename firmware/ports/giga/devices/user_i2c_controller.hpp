// SPDX-License-Identifier: GPL-3.0-or-later
// The user's I2C peripheral as master at up to 100 kHz (RM0399, chapter I2C). Uses no interrupt of
// its own, so noise on the wires cannot cause a storm of interrupts. The step timer's interrupt
// moves at most one byte each 25 us; a byte takes 90 us on the wire. A peripheral that waits for
// its next byte holds SCL low.
#pragma once

#include <cstddef>
#include <cstdint>

#include "../../../devices/user_i2c_port.hpp"
#include "../chip/gpio.hpp"
#include "../chip/i2c_controller.hpp"

namespace r4 {
namespace giga {

// TIMINGR for 8 to 250 MHz, rounded up: SCL low 5.0 us, high 4.7 us, hold 0.25 us, set-up 1.25 us.
std::uint32_t user_i2c_timing(std::uint32_t kernel_hz);

class UserI2cController final : public firmware::UserI2cPort {
 public:
  explicit UserI2cController(const I2cController::Parts& parts);

  void start(std::uint32_t kernel_hz);  // the peripheral's clock, which must be on
  void tick() {                         // in the step timer's interrupt
    if (stage_ != Stage::idle) step();
  }

  void begin(const firmware::UserTransfer& transfer) override;
  Progress progress() override { return stage_ == Stage::idle ? result_ : Progress::busy; }
  void release() override;
  void drive(bool scl, bool sda) override;
  bool scl_is_high() override { return read(scl_); }
  bool sda_is_high() override { return read(sda_); }
  void resume() override;

 private:
  enum class Stage : std::uint8_t { idle, sending, receiving };
  void request(Stage stage, std::size_t size, std::uint32_t flags);
  void step();
  void send_step(std::uint32_t status);
  void receive_step(std::uint32_t status);
  void end(Progress result);

  I2C_TypeDef& registers_;
  const Line scl_;
  const Line sda_;
  firmware::UserTransfer transfer_;
  std::size_t done_ = 0;  // bytes in this direction
  volatile Stage stage_ = Stage::idle;
  volatile Progress result_ = Progress::done;
};

}  // namespace giga
}  // namespace r4
