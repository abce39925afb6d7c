// SPDX-License-Identifier: GPL-3.0-or-later
// The I2C peripheral of the user's bus as master, by its registers (RM0399, chapter I2C), at no more than
// 100 kHz, which every device can.
//
// It has no interrupt of its own, so that no noise on its wires can make a storm of them: the step timer's,
// each 25 us, moves a byte if one is due, and a byte takes 90 us on the wire. What runs there looks at one
// register, or at none while nothing is under way. A peripheral that gets no byte in time waits, SCL low.
#pragma once

#include <cstddef>
#include <cstdint>

#include "../../../devices/user_i2c_port.hpp"
#include "../chip/gpio.hpp"
#include "../chip/i2c_controller.hpp"

namespace r4 {
namespace giga {

// TIMINGR for a kernel clock of 8 to 250 MHz: SCL low 5.0 us, high 4.7 us, data held 0.25 us and set up
// 1.25 us before the edge, rounded up.
std::uint32_t user_i2c_timing(std::uint32_t kernel_hz);

class UserI2cController final : public firmware::UserI2cPort {
 public:
  explicit UserI2cController(const I2cController::Wiring& wiring);

  // `kernel_hz`: the peripheral's clock, which must be on.
  void start(std::uint32_t kernel_hz);
  // In the interrupt of the step timer.
  void tick() {
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
  std::size_t done_ = 0;  // bytes, in this direction
  volatile Stage stage_ = Stage::idle;
  volatile Progress result_ = Progress::done;
};

}  // namespace giga
}  // namespace r4
