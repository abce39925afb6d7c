// SPDX-License-Identifier: GPL-3.0-or-later
// An I2C peripheral as master at up to 400 kHz (RM0399, chapter I2C). A transfer that lost the bus
// or timed out is repeated once, on a freed bus, so that one disturbance does not stop the robot. A
// read with a bus error (BERR) is also repeated, because its chip may have left the bus. A write
// ignores bus errors: a chip that left does not acknowledge, and as master the peripheral reports
// false bus errors (ST errata ES0430 2.15.2). The core's Wire waits 36 ms a byte on a hung bus.
#pragma once

#include <cstddef>
#include <cstdint>

#include "../../../drivers/i2c_bus.hpp"
#include "gpio.hpp"

namespace r4 {
namespace giga {

// TIMINGR for a kernel clock of 4 to 250 MHz, rounded up: SCL low 1.5 us, high 1.0 us, data hold
// 0.25 us, set-up 0.4 us. The peripheral's edge detection keeps the bus a little below 400 kHz.
std::uint32_t i2c_timing(std::uint32_t kernel_hz);

class I2cController final : public firmware::I2cBus {
 public:
  struct Parts {
    I2C_TypeDef* registers;
    Pin scl;
    Pin sda;
    std::uint32_t scl_function;  // alternate function of the pin
    std::uint32_t sda_function;
  };
  // In microseconds that wrap. Must also run in interrupts and fault handlers.
  using Clock = std::uint32_t (*)();

  I2cController(const Parts& parts, Clock clock);

  void start(std::uint32_t kernel_hz);  // the peripheral's clock, which must be on

  // At most 255 bytes each way, else no_acknowledge. An empty write probes the address.
  firmware::I2cResult write(std::uint8_t address, const std::uint8_t* bytes,
                            std::size_t size) override;
  firmware::I2cResult write_read(std::uint8_t address, const std::uint8_t* out,
                                 std::size_t out_size, std::uint8_t* in,
                                 std::size_t in_size) override;
  bool recover() override;

  static constexpr std::size_t max_size = 255;

 private:
  struct Transfer {
    std::uint32_t recovery;  // recoveries_ at its start
    std::uint32_t began_us;
    std::uint32_t limit_us;
  };
  static constexpr int attempts = 2;
  template <class Attempt>
  firmware::I2cResult transfer(std::size_t bytes, std::size_t starts, Attempt attempt);
  bool alive(const Transfer& transfer) const;
  bool request(const Transfer& transfer, std::uint32_t cr2);
  bool put(const Transfer& transfer, std::uint8_t byte);
  firmware::I2cResult wait_until_free(const Transfer& transfer);
  firmware::I2cResult send(const Transfer& transfer, std::uint8_t address,
                           const std::uint8_t* bytes, std::size_t size, bool then_stop);
  firmware::I2cResult receive(const Transfer& transfer, std::uint8_t address, std::uint8_t* bytes,
                              std::size_t size);
  firmware::I2cResult finish(const Transfer& transfer, firmware::I2cResult result);
  void restart();
  void pause_us(std::uint32_t us) const;
  bool release_scl();
  bool free_lines();

  I2C_TypeDef& registers_;
  const Line scl_;
  const Line sda_;
  const Clock clock_;
  volatile std::uint32_t recoveries_ = 0;
  volatile bool under_way_ = false;  // also until an interrupted transfer has returned
};

}  // namespace giga
}  // namespace r4
