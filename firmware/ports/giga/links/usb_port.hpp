// SPDX-License-Identifier: GPL-3.0-or-later
// USB serial as a port of the application: one datagram a line, and a few words for people.
//
// Nothing here waits for the host. The core's Serial.write() would, for ever, when a program has
// the port open and does not read; so lines go out by send_nb(), a packet at a time, whole or not
// at all, and the newest state wins (transmit_lines.hpp).
//
// Input is taken from the core, and a stop among it heard, in an interrupt that gives way to all
// others: whatever the loop is busy with. When its ring is full, the rest waits at the host.
//
// The line `report` is for the board itself. All but take_in() and listen(): from the loop only.
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
  // A full packet: more is to come. The core takes no more at a time.
  static constexpr std::uint32_t packet_size = 64;

  // In one receive(); the rest waits at the host, so that a flood of input takes no time from the
  // rest of the board.
  static constexpr int packets_per_turn = 8;

  static constexpr std::uint32_t receive_capacity = 1024;

  // Has listen() called for each packet that comes.
  static void start();
  // Asks for the interrupt (SWPMI1_IRQn, whose peripheral nobody uses) that calls take_in(); from
  // anywhere.
  static void listen();
  // In that interrupt: takes what has come. True: E:STOP is among it.
  bool take_in();
  bool has_received() const { return !received_.empty(); }

  // Calls `on_line(Text)` for each line that has arrived.
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

  // Lets time pass and sends what the host takes now. True: the host has just closed the port, or
  // the cable is out.
  bool poll(std::uint32_t now_ms);

  void send(Text datagram, Priority priority, std::uint32_t peer) override;
  std::size_t max_size() const override { return max_datagram; }
  bool may_configure() const override { return true; }

  // Has the host asked for new firmware, by 1200 baud? From then on the core resets the chip into
  // its boot loader as soon as the port is closed, 200 ms later at the earliest, whatever the speed
  // is then.
  bool upload_asked();

  // A line of a report. False: no room now.
  bool say(Text line);

  bool open() const { return open_; }
  std::uint32_t dropped() const { return lines_.dropped(); }

 private:
  void fill_packet();
  void send_packet();

  firmware::TransmitLines lines_;
  LineFraming framing_;
  firmware::ByteRing<receive_capacity> received_;
  // Of take_in() alone.
  firmware::StopDetector detector_;
  bool heard_open_ = false;

  bool open_ = false;
  bool upload_asked_ = false;
  std::uint8_t packet_[packet_size];
  std::uint32_t packet_used_ = 0;
  std::uint32_t packet_sent_ = 0;
};

}  // namespace giga
}  // namespace r4
