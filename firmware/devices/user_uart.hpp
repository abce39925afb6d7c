// SPDX-License-Identifier: GPL-3.0-or-later
// A UART for the user (docs/how-to/devices.md).
//
// Received bytes are kept in order and counted. A state has up to 64 new bytes. If there is room,
// the state first repeats bytes that were new in the previous state:
//     kept        … 100                               164          190
//     a state              |--------- new ------------|
//     the next             |---- again ----|--- new (26) ---|          position 126, 64 bytes
//
// With up to 32 bytes a period, one lost state loses no bytes. A larger loss shows in the position.
#pragma once

#include <cstddef>
#include <cstdint>

#include "r4link/vocabulary.hpp"
#include "user_uart_port.hpp"

namespace r4 {
namespace firmware {

class UserUart {
 public:
  explicit UserUart(UserUartPort& port) : port_(port) {}

  // An unchanged mode has no effect.
  void set_up(const UartMode& mode);
  bool on() const { return mode_.on(); }
  bool write(const std::uint8_t* bytes, std::size_t size) { return port_.send(bytes, size); }
  void drop_writes() { port_.drop(); }
  // A session begins or resumes: drops bytes received before.
  void forget();

  // Takes at most bytes_a_turn. Call at each turn of the loop.
  void poll();
  // Chooses the bytes of the next state, which tell() returns.
  void next_state();
  void tell(UartBytes& out) const;

  // Holds a burst of 530 bytes at 115200 baud and 100 states per second. Further bytes
  // are lost and counted.
  static constexpr std::uint32_t capacity = 344;
  static constexpr std::uint32_t backlog = capacity - uart_max_bytes;
  static constexpr std::size_t bytes_a_turn = 64;

 private:
  UserUartPort& port_;
  UartMode mode_;
  std::size_t place_of(std::uint32_t position) const;

  // Positions in the received bytes; all wrap.
  std::uint32_t kept_ = 0;   // the next byte
  std::uint32_t told_ = 0;   // end of the newest state
  std::uint32_t first_ = 0;  // start of the newest state
  std::uint32_t new_ = 0;    // first new byte of the newest state
  std::uint32_t lost_ = 0;
  std::uint32_t end_ = 0;  // index in bytes_ of the next byte
  std::uint8_t bytes_[capacity];
};

}  // namespace firmware
}  // namespace r4
