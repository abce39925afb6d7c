// SPDX-License-Identifier: GPL-3.0-or-later
// WiFi and UDP on a thread of their own: joins the network of the settings, joins again when it is
// lost or the settings change, and carries datagrams between a socket and a UdpLink.
//
//          settings name a network       joined            gone, or other settings
//     idle -----------------------> joining -----> up -----------------------------> joining or idle
//                                      ^   | not joined: again after retry_ms
//                                      +---+
//
// Joining scans first and takes up to 7 s, and without WiFi firmware in the flash the library never
// returns: all of that is this thread's alone. What the library says of the
// connection may be wrong for long: only heartbeats decide whether the host is there, and when hosts
// that were there have been silent for quiet_ms the network is joined anew. The thread has the lowest
// priority: where the library spins, it spins alone.
#pragma once

#include <atomic>
#include <cstdint>

#include "../../../../protocol/messages/site_settings.hpp"
#include "hand_over.hpp"
#include "udp_peers.hpp"
#include "udp_port.hpp"

// clang-format off
#include "../chip/chip.hpp"
#include <WiFi.h>
#include <netsocket/UDPSocket.h>
// clang-format on

namespace r4 {
namespace giga {

enum class NetworkState : std::uint8_t { idle, joining, up };

class Network {
 public:
  static constexpr std::uint32_t retry_ms = 2000;
  static constexpr std::uint32_t quiet_ms = 60000;

  explicit Network(UdpLink& link) : link_(link) {}

  // Once, from the loop.
  void start();
  // What to join, and at which port to listen; from the loop, at any time.
  void use(const SiteSettings& settings);

  NetworkState state() const { return state_.load(std::memory_order_relaxed); }
  std::uint32_t ip() const { return ip_.load(std::memory_order_relaxed); }  // ours; 0: none

  // One turn of the thread; true: it has done something, and may have more to do.
  bool turn();

 private:
  // What of the settings is this thread's.
  struct Wanted {
    char network[network_max + 1];
    char password[password_max + 1];
    std::uint32_t host;
    std::uint16_t udp_port;
  };

  static void run(Network* network);
  void take_settings();
  void join();
  void leave();
  bool carry();
  bool send_next();
  bool receive_next();

  static constexpr std::uint32_t stack_size = 8192;

  UdpLink& link_;
  HandOver<Wanted> handed_over_;
  std::atomic<NetworkState> state_{NetworkState::idle};
  std::atomic<std::uint32_t> ip_{0};
  // Of the thread alone.
  std::uint32_t version_ = 0;
  Wanted wanted_ = {};
  UdpPeers peers_;
  bool tried_ = false;
  std::uint32_t tried_ms_ = 0;
  bool heard_ = false;  // somebody, since we joined
  std::uint32_t heard_ms_ = 0;
  UDPSocket socket_;  // never blocks: the core's WiFiUDP can wait a second in either direction

  alignas(8) unsigned char stack_[stack_size];
  rtos::Thread thread_{osPriorityBelowNormal, stack_size, stack_, "r4-network"};
};

}  // namespace giga
}  // namespace r4
