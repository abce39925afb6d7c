// SPDX-License-Identifier: GPL-3.0-or-later
// UDP over the LAN9118. Datagrams for all go to the controlling host, else to the host heard last.
#pragma once

#include <cstdint>

#include "../../../../transports/framing/peer_table.hpp"
#include "../../../port.hpp"
#include "../../../stop_detector.hpp"
#include "../chip/registers.hpp"
#include "lan9118.hpp"
#include "udp_frames.hpp"

namespace r4 {
namespace m7 {

class UdpPort final : public firmware::Port {
 public:
  UdpPort(std::uint32_t address, std::uint16_t port) : frames_(address, port) {}
  bool start() {
    if (!chip_.start()) return false;
    frames_.set_mac(chip_.mac());
    return true;
  }

  // Takes received frames. Call in the interrupt, or with interrupts off.
  void on_interrupt() {
    Lan9118::on_interrupt();
    while (put_ - taken_ < frames_max && chip_.has_received()) {
      Frame& frame = received_[put_ % frames_max];
      frame.size = chip_.receive(frame.words);
      if (frame.size == 0) continue;
      if (firmware::is_stop(UdpFrames::peek(frame.bytes(), frame.size))) stop_ = true;
      put_ = put_ + 1;
    }
  }
  // True if a stop has arrived since the last call. Call in the interrupt.
  bool take_stop() {
    const bool stop = stop_;
    stop_ = false;
    return stop;
  }

  // Calls `on_datagram(peer, Text)` for each datagram. Takes at most frames_max of a flood.
  template <class OnDatagram>
  void receive(OnDatagram&& on_datagram) {
    for (std::uint32_t i = 0; i < frames_max && has_received(); ++i) {
      const Frame& frame = received_[taken_ % frames_max];
      std::uint32_t reply[UdpFrames::min_frame / 4];
      const UdpFrames::Arrival arrival =
          frames_.take(frame.bytes(), frame.size, reinterpret_cast<std::uint8_t*>(reply));
      if (arrival.reply_size != 0) chip_.send(reply, arrival.reply_size);
      if (arrival.from.host != 0) {
        on_datagram(hosts_.heard(arrival.from, arrival.datagram), arrival.datagram);
      }
      taken_ = taken_ + 1;
      const InterruptsHeld held;
      on_interrupt();  // there is room for another frame
    }
  }
  bool has_received() const { return put_ != taken_; }

  void send(Text datagram, Priority, std::uint32_t peer) override {
    const UdpAddress* const to = hosts_.find(peer == everyone ? hosts_.audience() : peer);
    if (to == nullptr) return;
    const std::size_t size = frames_.write(*to, datagram, reinterpret_cast<std::uint8_t*>(out_));
    if (size == 0 || !chip_.send(out_, size)) ++dropped_;
  }
  void hold(std::uint32_t peer) override { hosts_.hold(peer); }
  void also_hold(std::uint32_t peer) override { hosts_.also_hold(peer); }
  std::size_t max_size() const override { return max_datagram; }

  std::uint32_t dropped() const { return dropped_; }
  std::uint32_t bad() const { return frames_.bad(); }

 private:
  static constexpr std::uint32_t frames_max = 4;
  struct Frame {
    const std::uint8_t* bytes() const { return reinterpret_cast<const std::uint8_t*>(words); }
    std::size_t size;
    std::uint32_t words[Lan9118::max_frame / 4];
  };

  Lan9118 chip_;
  UdpFrames frames_;
  Frame received_[frames_max];
  volatile std::uint32_t put_ = 0;
  volatile std::uint32_t taken_ = 0;
  volatile bool stop_ = false;
  PeerTable<UdpAddress, 16> hosts_;
  std::uint32_t dropped_ = 0;
  std::uint32_t out_[(UdpFrames::max_frame + 3) / 4];
};

}  // namespace m7
}  // namespace r4
