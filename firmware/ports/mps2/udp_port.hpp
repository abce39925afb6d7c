// SPDX-License-Identifier: GPL-3.0-or-later
// UDP over the LAN9118 as a port of the application. What is for everyone goes to the host heard
// last; before one was heard, nowhere.
#pragma once

#include <cstdint>

#include "../../port.hpp"
#include "lan9118.hpp"
#include "udp_frames.hpp"

namespace r4 {
namespace mps2 {

class UdpPort final : public firmware::Port {
 public:
  UdpPort(std::uint32_t address, std::uint16_t port) : frames_(address, port) {}
  // False: there is no Ethernet.
  bool start() {
    if (!chip_.start()) return false;
    frames_.set_mac(chip_.mac());
    return true;
  }

  // Calls `on_datagram(peer, Text)` for each that has arrived.
  template <class OnDatagram>
  void receive(OnDatagram&& on_datagram) {
    while (chip_.has_received()) {
      const std::size_t size = chip_.receive(in_);
      std::uint32_t reply[UdpFrames::min_frame / 4];
      const UdpFrames::Arrival arrival = frames_.take(reinterpret_cast<const std::uint8_t*>(in_),
                                                      size, reinterpret_cast<std::uint8_t*>(reply));
      if (arrival.reply_size != 0) chip_.send(reply, arrival.reply_size);
      if (arrival.peer == 0) continue;
      last_peer_ = arrival.peer;
      on_datagram(arrival.peer, arrival.datagram);
    }
  }
  bool has_received() const { return chip_.has_received(); }

  void send(Text datagram, firmware::Urgency, std::uint32_t peer) override {
    const std::uint32_t to = peer == firmware::everyone ? last_peer_ : peer;
    if (to == firmware::everyone) return;
    const std::size_t size = frames_.write(to, datagram, reinterpret_cast<std::uint8_t*>(out_));
    if (size == 0 || !chip_.send(out_, size)) ++dropped_;
  }
  std::size_t max_size() const override { return max_datagram; }

  std::uint32_t dropped() const { return dropped_; }
  std::uint32_t bad() const { return frames_.bad(); }

 private:
  Lan9118 chip_;
  UdpFrames frames_;
  std::uint32_t last_peer_ = firmware::everyone;
  std::uint32_t dropped_ = 0;
  std::uint32_t in_[Lan9118::max_frame / 4];
  std::uint32_t out_[(UdpFrames::max_frame + 3) / 4];
};

}  // namespace mps2
}  // namespace r4
