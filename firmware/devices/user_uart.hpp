// SPDX-License-Identifier: GPL-3.0-or-later
// A UART of the user's: bytes out by command, bytes in as a field of the state (docs/devices.md).
//
// What comes in is kept in the order in which it came, and counted. A state takes up to 64 bytes that are new,
// and in front of them, where there is room, those that were new in the state before:
//
//     kept        … 100                               164          190
//     a state              |--------- new ------------|
//     the next             |---- again ----|--- new (26) ---|          position 126, 64 bytes
//
// So a state that is lost alone loses nothing as long as no more than 32 bytes come in a period, and what it
// loses otherwise shows: the next one's position is behind the end of the last.
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

  // The setting; the same again changes nothing.
  void set_up(const UartMode& mode);
  bool on() const { return mode_.on(); }
  // Will be sent, all or nothing. False: there is no room now.
  bool write(const std::uint8_t* bytes, std::size_t size) { return port_.send(bytes, size); }
  // The board is safe: what waits to be sent is not sent any more.
  void drop_writes() { port_.drop(); }
  // A session begins, or resumes: what came before is nobody's, or old.
  void forget();

  // A turn of the loop: at most bytes_a_turn are taken.
  void poll();
  // A state is made: what it tells.
  void next_state();
  void tell(UartBytes& out) const;

  // Waits for states: a burst of 530 bytes at 115200 baud, of which 100 states a second carry half as it comes. What
  // comes when so much waits is lost, and counted.
  static constexpr std::uint32_t capacity = 344;
  static constexpr std::uint32_t backlog = capacity - uart_max_bytes;
  static constexpr std::size_t bytes_a_turn = 64;

 private:
  UserUartPort& port_;
  UartMode mode_;
  std::size_t place_of(std::uint32_t position) const;

  // Positions in what was kept. All wrap.
  std::uint32_t kept_ = 0;   // the next one
  std::uint32_t told_ = 0;   // behind the newest state's
  std::uint32_t first_ = 0;  // of the newest state's
  std::uint32_t new_ = 0;    // … that was new in it
  std::uint32_t lost_ = 0;
  std::uint32_t end_ = 0;  // where in bytes_ the next one goes
  std::uint8_t bytes_[capacity];
};

}  // namespace firmware
}  // namespace r4
