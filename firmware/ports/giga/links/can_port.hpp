// SPDX-License-Identifier: GPL-3.0-or-later
// The CAN bus as a port of the application (docs/reference/can.md): datagrams over ISO-TP. Two
// lanes, dialogue and telemetry, each with one transfer at a time. In telemetry, heartbeats come
// first, then the newest state. A full queue drops and counts new datagrams. When the bus is lost,
// or stuck for Fdcan::stale_us, all waiting datagrams are dropped. Never waits. For the loop only.
#pragma once

#include <cstdint>

#include "../../../../transports/framing/can/can_node.hpp"
#include "../chip/fdcan.hpp"
#include "datagram_ring.hpp"

namespace r4 {
namespace giga {

class CanPort final : public firmware::Port {
 public:
  using Clock = std::uint32_t (*)();  // microseconds that wrap

  CanPort(Fdcan& controller, std::uint8_t node, Clock clock)
      : controller_(controller), clock_(clock), node_(CanEnd::board, node, false) {}

  // Calls `on_datagram(Text)` for each datagram. True: the bus was lost since the last call.
  template <class OnDatagram>
  bool receive(OnDatagram&& on_datagram) {
    const Fdcan::Event event = controller_.poll(clock_());
    if (event != Fdcan::Event::none) forget();
    CanFrame frame;
    for (int i = 0; i < frames_per_turn && controller_.receive(frame); ++i) {
      const Text datagram = node_.on_frame(frame, clock_());
      pump();  // the sender waits for flow control
      if (!datagram.empty()) on_datagram(datagram);
    }
    node_.poll(clock_());
    pump();
    return event == Fdcan::Event::bus_off;
  }

  void send(Text datagram, Priority priority, std::uint32_t peer) override;
  std::size_t max_size() const override { return max_datagram; }
  void use_packed_form(bool wanted) override { node_.use_packed_form(wanted); }
  bool is_bus() const override { return true; }

  std::uint32_t dropped() const { return dropped_; }
  const CanNode& node() const { return node_; }

 private:
  static constexpr std::uint32_t queue_bytes = 1024;
  static constexpr int frames_per_turn = 32;  // a full bus carries eight per millisecond

  void pump();
  bool begin_next(CanLane lane, DatagramRing<queue_bytes>& queue);
  void forget();

  Fdcan& controller_;
  const Clock clock_;
  CanNode node_;
  DatagramRing<queue_bytes> replies_;
  DatagramRing<queue_bytes> heartbeats_;
  char state_[max_datagram];
  std::size_t state_size_ = 0;
  std::uint32_t dropped_ = 0;
};

}  // namespace giga
}  // namespace r4
