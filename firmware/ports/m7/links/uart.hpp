// SPDX-License-Identifier: GPL-3.0-or-later
// The CMSDK UART as a port: one datagram a line. Handlers run in its interrupts. Never waits.
#pragma once

#include <cstdint>

#include "../../../../transports/framing/line_framing.hpp"
#include "../../../port.hpp"
#include "../../../stop_detector.hpp"
#include "../../byte_ring.hpp"
#include "../../transmit_lines.hpp"

namespace r4 {
namespace m7 {

class Uart final : public firmware::Port {
 public:
  static constexpr std::uint32_t receive_capacity = 2048;

  // `base` is the UART's address. Runs at 1 Mbit/s.
  explicit Uart(std::uint32_t base) : base_(base) {}
  void start();

  void on_receive_interrupt();
  void on_transmit_interrupt();
  void on_byte(char byte);
  // True if a stop has arrived since the last call. Call in the receive interrupt.
  bool take_stop() {
    const bool stop = stop_;
    stop_ = false;
    return stop;
  }

  // Calls `on_datagram(Text)` for each line. Takes at most receive_capacity bytes of a flood.
  template <class OnDatagram>
  void receive(OnDatagram&& on_datagram) {
    char chunk[64];
    for (std::uint32_t taken = 0; taken < receive_capacity; taken += sizeof chunk) {
      const std::uint32_t size = received_.take(chunk, sizeof chunk);
      if (size == 0) return;
      framing_.push(chunk, size, on_datagram);
    }
  }
  bool has_received() const { return !received_.empty(); }

  void send(Text datagram, Priority priority, std::uint32_t peer) override;
  std::size_t max_size() const override { return max_datagram; }
  bool may_configure() const override { return true; }
  void poll(std::uint32_t now_ms);

  // BoardClock::ticks() at the end of the last line.
  std::uint32_t last_line_ticks() const { return last_line_ticks_; }
  std::uint32_t overruns() const { return overruns_; }  // received bytes that were lost
  std::uint32_t dropped() const { return lines_.dropped(); }

 private:
  void fill();

  const std::uint32_t base_;
  firmware::ByteRing<receive_capacity> received_;
  firmware::TransmitLines lines_;
  LineFraming framing_;
  firmware::StopDetector detector_;
  bool stop_ = false;
  volatile std::uint32_t last_line_ticks_ = 0;
  volatile std::uint32_t overruns_ = 0;
};

// The board's log. Waits for the UART for a limited time. A fault handler may call it at any time.
class Log {
 public:
  explicit Log(std::uint32_t base);
  const Log& text(Text text) const;
  const Log& hex(std::uint32_t value) const;
  const Log& number(std::uint32_t value) const;

 private:
  const std::uint32_t base_;
};

}  // namespace m7
}  // namespace r4
