// SPDX-License-Identifier: GPL-3.0-or-later
// USB serial as a port of the application. A line is a datagram, or `report`, which requests the
// board's report. If a program does not read, the core's Serial.write() waits for ever. So the
// core's send_nb() sends lines, one packet at a time, whole or not at all. The newest state
// replaces older states. A low-priority interrupt takes input and detects a stop while the loop is
// busy. While the ring is full, input waits at the host. Call all functions from the loop, except
// take_in() and listen().
#pragma once

#include <cstdint>

#include "../../../../transports/framing/line_framing.hpp"
#include "../../../port.hpp"
#include "../../../stop_detector.hpp"
#include "../../byte_ring.hpp"
#include "../../transmit_lines.hpp"

namespace r4 {
namespace giga {

class UsbPort final : public firmware::Port {
 public:
  // The most that the core takes at a time. Another packet must follow a packet of this size.
  static constexpr std::uint32_t packet_size = 64;

  // The limit of one receive(), so that a flood of input does not delay the board.
  static constexpr int packets_per_turn = 8;

  static constexpr std::uint32_t receive_capacity = 1024;

  // Makes the core call listen() for each packet.
  static void start();
  // Requests the interrupt for take_in(): SWPMI1_IRQn, otherwise unused. Call from anywhere.
  static void listen();
  // Call in the interrupt of listen(). True if E:STOP was received.
  bool take_in();
  bool has_received() const { return !received_.empty(); }

  // Call before receive(). True if the port was closed and opened again since the last turn.
  bool begin_turn();

  // Calls `on_line(Text)` for each line.
  template <class OnLine>
  void receive(OnLine&& on_line) {
    char chunk[packet_size];
    for (int i = 0; i < packets_per_turn; ++i) {
      const std::uint32_t size = received_.take(chunk, sizeof chunk);
      if (size == 0) break;
      framing_.push(chunk, size, on_line);
    }
    listen();  // there is room again
  }

  // Sends as much as the host takes. True: the host closed the port. A Giga with its own supply
  // may not notice that the cable is unplugged.
  bool poll(std::uint32_t now_ms);

  void send(Text datagram, Priority priority, std::uint32_t peer) override;
  std::size_t max_size() const override { return max_datagram; }
  bool may_configure() const override { return true; }

  // True if the host has requested a firmware upload (1200 baud). From then on the core resets into
  // its boot loader when the port closes, at least 200 ms later, at any speed.
  bool upload_asked();

  bool say(Text line);

  bool open() const { return open_; }
  std::uint32_t dropped() const { return lines_.dropped(); }

 private:
  void forget_lines();
  void fill_packet();
  void send_packet();

  firmware::TransmitLines lines_;
  LineFraming framing_;
  firmware::ByteRing<receive_capacity> received_;
  // Used by take_in() only.
  firmware::StopDetector detector_;
  bool heard_open_ = false;

  bool connected_ = false;  // when the turn began
  bool open_ = false;
  bool upload_asked_ = false;
  std::uint8_t packet_[packet_size];
  std::uint32_t packet_used_ = 0;
  std::uint32_t packet_sent_ = 0;
};

}  // namespace giga
}  // namespace r4
