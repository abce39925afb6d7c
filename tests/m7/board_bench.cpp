// SPDX-License-Identifier: GPL-3.0-or-later
#include "board_bench.hpp"

#include <cstring>
#include <new>

#include "protocol/messages/message.hpp"
#include "protocol/messages/state_fields.hpp"

namespace r4 {
namespace m7 {

void (*on_step)() = nullptr;
Bench* bench = nullptr;

Bench& new_board() {
  alignas(Bench) static unsigned char room[sizeof(Bench)];
  bench = new (room) Bench;
  return *bench;
}

namespace {

// In loopback the Ethernet chip receives the frames that it sends (IEEE 802.3, 22.2.4.1.2).
void hear_oneself() {
  constexpr std::uint32_t mac_command = ethernet_base + 0xA4;
  constexpr std::uint32_t mac_data = ethernet_base + 0xA8;
  constexpr std::uint32_t busy = 1U << 31;
  constexpr std::uint32_t mii_access = 6;
  constexpr std::uint32_t mii_data = 7;
  constexpr std::uint32_t loopback = 1U << 14;
  constexpr std::uint32_t write_control = 1U << 11 | 2;  // register 0 of PHY 1
  at(mac_data) = loopback;
  at(mac_command) = busy | mii_data;
  at(mac_data) = write_control;
  at(mac_command) = busy | mii_access;
}

// A valid datagram from 10.0.2.2:5000 to the board, its UDP checksum 0 (none).
std::size_t write_hello(const Mac& mac, std::uint8_t* frame) {
  static const std::uint8_t hello[UdpFrames::min_frame] = {
      0,    0,    0,    0,    0,   0,   0,   0,   0,   0,   0,    0,    8,   0,  // Ethernet
      0x45, 0,    0,    43,   0,   0,   0,   0,   64,  17,  0x62, 0xB2, 10,  0,   2,  2,  // IP
      10,   0,    2,    15,                                                               //
      0x13, 0x88, 0x07, 0xE2, 0,   23,  0,   0,                                           // UDP
      'T',  ':',  '1',  ';',  '^', '0', 'x', '1', 'e', 'f', '9',  'a',  'b', 'f', '^'};
  std::memcpy(frame, hello, sizeof hello);
  std::memcpy(frame, mac.bytes, sizeof mac.bytes);
  std::memcpy(frame + 6, mac.bytes, sizeof mac.bytes);
  return sizeof hello;
}

}  // namespace

// The board and the listener share one Ethernet chip, so both have the same MAC address. The board
// gets the frames for its IP address.
void Listener::start(UdpPort& board) {
  EXPECT(board.start() && chip_.start());
  hear_oneself();
  while (chip_.receive(words_) != 0) {
  }
  const Mac mac = chip_.mac();
  frames_.set_mac(mac);
  EXPECT(chip_.send(words_, write_hello(mac, reinterpret_cast<std::uint8_t*>(words_))));
  const InterruptsHeld held;
  board.on_interrupt();
  EXPECT(board.has_received());
}

void Listener::hear() {
  while (chip_.has_received()) {
    const std::size_t size = chip_.receive(words_);
    std::uint32_t reply[UdpFrames::min_frame / 4];
    const UdpFrames::Arrival arrival = frames_.take(reinterpret_cast<std::uint8_t*>(words_), size,
                                                    reinterpret_cast<std::uint8_t*>(reply));
    if (arrival.from.host != 0) on_datagram(arrival.datagram);
  }
}

void Listener::on_datagram(Text bytes) {
  Datagram datagram;
  if (!read_datagram(bytes, datagram)) {
    ++bad_;
    return;
  }
  if (heard_) lost_ += datagram.pnum() - pnum_ - 1;
  heard_ = true;
  pnum_ = datagram.pnum();
  if (kind_of(datagram) != MessageKind::state) return;
  const std::uint32_t before_ms = state_.t_ms;
  if (!read_state(datagram, state_)) ++bad_;
  const std::uint32_t step_ms = state_.t_ms - before_ms;
  if (states_ != 0 && step_ms > longest_step_ms_) longest_step_ms_ = step_ms;
  ++states_;
}

}  // namespace m7
}  // namespace r4

extern "C" void r4_wake() {
  r4::m7::BoardClock::on_wake_interrupt();
  r4::m7::on_step();
}
