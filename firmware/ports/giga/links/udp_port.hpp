// SPDX-License-Identifier: GPL-3.0-or-later
// UDP as a port. WiFi may block its thread for seconds, so lock-free rings connect loop and thread.
//     loop                         network thread
//     UdpPort::send()     ----->   UdpLink::take()     skips states older than stale_ms
//     UdpPort::receive()  <-----   UdpLink::give()
//     true from receive() <-----   UdpLink::set_up(false)
//
// A full ring drops and counts new datagrams. States leave room for answers. States to hosts that
// are not in control also leave room for states to the controlling host.
#pragma once

#include <atomic>
#include <cstdint>

#include "datagram_ring.hpp"

namespace r4 {
namespace giga {

// Limit of the Giga's library (WIFI_UDP_BUFFER_SIZE).
constexpr std::size_t udp_max_size = 508;

class UdpLink {
 public:
  static constexpr std::uint32_t stale_ms = 50;

  // --- For the network thread.

  bool take(std::uint32_t now_ms, std::uint32_t& peer, char (&buffer)[max_datagram],
            Text& datagram) {
    DatagramNote note;
    while (to_network_.take(note, buffer, datagram)) {
      const bool state = note.priority == Priority::state;
      if (state && now_ms - note.time_ms > stale_ms) continue;
      peer = note.peer;
      return true;
    }
    return false;
  }
  void give(std::uint32_t peer, Text datagram) {
    DatagramNote note;
    note.peer = peer;
    if (!from_network_.put(note, datagram)) lost_.fetch_add(1, std::memory_order_relaxed);
  }
  // Peers that keep their numbers: the controlling host on all its paths. everyone: unused.
  static constexpr int most_held = 4;
  std::uint32_t held(int i) const { return held_[i].load(std::memory_order_relaxed); }
  void set_up(bool up) { up_.store(up, std::memory_order_release); }

  bool up() const { return up_.load(std::memory_order_acquire); }
  std::uint32_t lost() const { return lost_.load(std::memory_order_relaxed); }

 private:
  friend class UdpPort;
  static constexpr std::uint32_t ring_bytes = 4096;
  DatagramRing<ring_bytes> to_network_;
  DatagramRing<ring_bytes> from_network_;
  std::atomic<bool> up_{false};
  std::atomic<std::uint32_t> held_[most_held] = {};
  std::atomic<std::uint32_t> lost_{0};
};

class UdpPort final : public firmware::Port {
 public:
  using Clock = std::uint32_t (*)();  // milliseconds that wrap
  static constexpr std::uint32_t kept_for_answers = 1024;
  static constexpr std::uint32_t kept_for_host = 2048;
  static constexpr int datagrams_per_turn = 8;

  UdpPort(UdpLink& link, Clock now_ms) : link_(link), now_ms_(now_ms) {}

  // Calls `on_datagram(peer, Text)` for each datagram. True: the network was lost.
  template <class OnDatagram>
  bool receive(OnDatagram&& on_datagram) {
    DatagramNote note;
    char buffer[max_datagram];
    Text datagram;
    for (int i = 0; i < datagrams_per_turn && link_.from_network_.take(note, buffer, datagram);
         ++i) {
      on_datagram(note.peer, datagram);
    }
    const bool was_up = up_;
    up_ = link_.up();
    return was_up && !up_;
  }

  void send(Text datagram, Priority priority, std::uint32_t peer) override {
    if (!up_) return;
    DatagramNote note;
    note.peer = peer;
    note.time_ms = now_ms_();
    note.priority = priority;
    if (!link_.to_network_.put(note, datagram, kept_from(priority, peer))) ++dropped_;
  }
  void hold(std::uint32_t peer) override {
    link_.held_[0].store(peer, std::memory_order_relaxed);
    for (int i = 1; i < UdpLink::most_held; ++i) {
      link_.held_[i].store(everyone, std::memory_order_relaxed);
    }
  }
  void also_hold(std::uint32_t peer) override {
    int i = 0;
    while (i < UdpLink::most_held && link_.held(i) != everyone && link_.held(i) != peer) ++i;
    if (i < UdpLink::most_held) link_.held_[i].store(peer, std::memory_order_relaxed);
  }
  std::size_t max_size() const override { return udp_max_size; }

  std::uint32_t dropped() const { return dropped_; }

 private:
  std::uint32_t kept_from(Priority priority, std::uint32_t peer) const {
    if (priority != Priority::state) return 0;
    if (peer == everyone) return kept_for_answers;
    for (int i = 0; i < UdpLink::most_held; ++i) {
      if (peer == link_.held(i)) return kept_for_answers;
    }
    return kept_for_host;
  }

  UdpLink& link_;
  const Clock now_ms_;
  bool up_ = false;
  std::uint32_t dropped_ = 0;
};

}  // namespace giga
}  // namespace r4
