// SPDX-License-Identifier: GPL-3.0-or-later
// A USART for the user (RM0399, chapter USART), with its FIFOs of 16 bytes. Uses no interrupt of
// its own, so noise on the wire cannot cause a storm of interrupts. The step timer's interrupt
// moves up to two bytes in and one out each 25 us, enough for 460800 baud.
#pragma once

#include <cstddef>
#include <cstdint>

#include "../../../devices/user_uart_port.hpp"
#include "../../byte_ring.hpp"
#include "../chip/gpio.hpp"

namespace r4 {
namespace giga {

// PRESC and BRR for a kernel clock of 16 to 250 MHz.
struct UartTiming {
  std::uint32_t prescaler;
  std::uint32_t divider;
};
UartTiming user_uart_timing(std::uint32_t kernel_hz, std::uint32_t baud);

class UserUartController final : public firmware::UserUartPort {
 public:
  struct Parts {
    USART_TypeDef* registers;
    Pin tx;
    Pin rx;
    std::uint32_t function;
  };
  explicit UserUartController(const Parts& parts)
      : registers_(*parts.registers),
        tx_(line_of(parts.tx)),
        rx_(line_of(parts.rx)),
        function_(parts.function) {}

  void start(std::uint32_t kernel_hz);  // the peripheral's clock, which must be on
  // Call in the step timer's interrupt. `sends`: false until the loop has handled a safe state.
  void tick(bool sends) {
    if (runs_) move(sends);
  }

  void set_up(const UartMode& mode) override;
  std::size_t receive(std::uint8_t* out, std::size_t size) override;
  std::uint32_t take_lost() override;
  bool send(const std::uint8_t* bytes, std::size_t size) override;
  void drop() override;

 private:
  void begin();
  void move(bool sends);

  USART_TypeDef& registers_;
  const Line tx_;
  const Line rx_;
  const std::uint32_t function_;
  std::uint32_t kernel_hz_ = 0;  // 0: not started
  UartMode mode_;
  volatile bool runs_ = false;
  volatile std::uint32_t lost_ = 0;
  std::uint32_t told_lost_ = 0;
  firmware::ByteRing<256> received_;
  firmware::ByteRing<send_capacity> waiting_;
};

}  // namespace giga
}  // namespace r4
