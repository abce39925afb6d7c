// SPDX-License-Identifier: GPL-3.0-or-later
// A user's UART of the simulated board, and its peer. Bytes take as long as on the wire, both ways.
// If rate or form differ from the board's, the peer's bytes arrive damaged.
#pragma once

#include <cstddef>
#include <cstdint>

#include "../../../devices/user_uart_port.hpp"
#include "../../byte_ring.hpp"

namespace r4 {
namespace sim {

enum class UartPeer : std::uint8_t {
  none,
  loop,   // TX and RX are joined
  gnss,   // a receiver: RMC, GGA, GSA and two GSV every 100 ms; 115200:8N1
  lidar,  // a TFmini's nine bytes every 10 ms; 115200:8N1
  noise,  // endless bytes at full rate, one in four damaged
};
constexpr int uart_peer_count = 5;

class UserUartModel final : public firmware::UserUartPort {
 public:
  void connect(UartPeer peer);
  UartPeer peer() const { return peer_; }
  void pass_millisecond();
  void reset() { set_up(UartMode()); }

  void set_up(const UartMode& mode) override;
  std::size_t receive(std::uint8_t* out, std::size_t size) override;
  std::uint32_t take_lost() override;
  bool send(const std::uint8_t* bytes, std::size_t size) override;
  void drop() override;

  const UartMode& mode() const { return mode_; }
  std::uint32_t sent() const { return sent_; }  // bytes sent on the wire so far; wraps
  // Bytes that the peer has sent so far, damaged or not.
  std::uint32_t said() const { return said_; }

 private:
  static constexpr std::size_t longest_text = 96;
  std::uint32_t bits_of_byte() const;
  bool has_byte() const { return at_ != size_; }
  void say_more();
  void say_sentence();
  void say_distance();
  void arrive(std::uint8_t byte, bool damaged);
  void put(const char* text);
  void put_number(std::uint32_t value, int digits);

  UartMode mode_;
  UartPeer peer_ = UartPeer::none;
  std::uint32_t now_ms_ = 0;
  std::uint32_t out_bits_ = 0;  // thousandths of a bit's time that have passed, each way
  std::uint32_t in_bits_ = 0;
  std::uint32_t chance_ = 1;
  std::uint32_t lost_ = 0;
  std::uint32_t sent_ = 0;
  std::uint32_t said_ = 0;
  char text_[longest_text];
  std::size_t size_ = 0;
  std::size_t at_ = 0;
  int sentence_ = 0;  // the next sentence of this epoch
  firmware::ByteRing<256> received_;
  firmware::ByteRing<send_capacity> waiting_;
};

}  // namespace sim
}  // namespace r4
