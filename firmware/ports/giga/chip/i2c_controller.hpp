// SPDX-License-Identifier: GPL-3.0-or-later
// An I2C peripheral of the STM32H747 as master, by its registers (RM0399, chapter I2C), at no more
// than 400 kHz. It keeps what drivers/i2c_bus.hpp promises: no call waits longer than its time on the
// wire plus i2c_timeout_us, and recover() may come in an interrupt or a fault handler in the middle
// of a transfer. So may a transfer: it takes the bus over, and the one that it interrupted returns
// timeout.
//
// The core's own library (Wire) cannot be used: on a hung bus it waits 36 ms for each byte.
#pragma once

#include <cstddef>
#include <cstdint>

#include "../../../drivers/i2c_bus.hpp"
#include "gpio.hpp"

namespace r4 {
namespace giga {

// TIMINGR for a kernel clock of 4 to 250 MHz: SCL low 1.5 us, high 1.0 us, data held 0.25 us and set
// up 0.4 us before the edge, rounded up. The peripheral adds the time in which it sees its own edges,
// so the bus runs a little below 400 kHz.
std::uint32_t i2c_timing(std::uint32_t kernel_hz);

class I2cController final : public firmware::I2cBus {
 public:
  struct Wiring {
    I2C_TypeDef* registers;
    Pin scl;
    Pin sda;
    std::uint32_t scl_function;  // alternate function of the pin
    std::uint32_t sda_function;
  };
  // Microseconds that wrap; must go on in an interrupt and in a fault handler.
  using Clock = std::uint32_t (*)();

  I2cController(const Wiring& wiring, Clock clock);

  // `kernel_hz`: the peripheral's clock, which must be on.
  void start(std::uint32_t kernel_hz);

  // At most 255 bytes each way; more is refused as not acknowledged. Without bytes: does anybody
  // answer to the address?
  firmware::I2cResult write(std::uint8_t address, const std::uint8_t* bytes,
                            std::size_t size) override;
  firmware::I2cResult write_read(std::uint8_t address, const std::uint8_t* out,
                                 std::size_t out_size, std::uint8_t* in,
                                 std::size_t in_size) override;
  bool recover() override;

  static constexpr std::size_t max_size = 255;

 private:
  // One transfer as long as nobody interrupts it.
  struct Transfer {
    std::uint32_t recovery;  // recoveries_ when it began
    std::uint32_t began_us;
    std::uint32_t limit_us;
  };
  Transfer begin(std::size_t bytes, std::size_t starts);
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

  I2C_TypeDef& registers_;
  const Line scl_;
  const Line sda_;
  const Clock clock_;
  volatile std::uint32_t recoveries_ = 0;
  volatile bool under_way_ = false;  // a transfer, or one that was taken over
};

}  // namespace giga
}  // namespace r4
