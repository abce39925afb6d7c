// SPDX-License-Identifier: GPL-3.0-or-later
// WiFi and UDP on their own thread: joins the network of the settings and carries datagrams between
// a socket and a UdpLink. Rejoins when the network is lost or the settings change.
//          settings name a network       joined            lost, or other settings
//     idle -----------------------> joining -----> up ---------------------------> joining or idle
//                                      ^   | not joined: again after retry_ms
//                                      +---+
//
// Joining takes up to 7 s. Without WiFi firmware in the flash the library spins for ever, so the
// thread has a lower priority than our other threads. The library's status may be wrong for a long
// time, so the network is also rejoined when hosts that sent datagrams are silent for quiet_ms.
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

  void start();                            // once, from the loop
  void use(const SiteSettings& settings);  // from the loop, at any time

  NetworkState state() const { return state_.load(std::memory_order_relaxed); }
  std::uint32_t ip() const { return ip_.load(std::memory_order_relaxed); }  // the board's; 0: none

  // One turn of the thread. True if there may be more to do.
  bool turn();

 private:
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
  // Used by the thread only.
  std::uint32_t version_ = 0;
  Wanted wanted_ = {};
  UdpPeers peers_;
  bool tried_ = false;
  std::uint32_t tried_ms_ = 0;
  bool heard_ = false;  // a datagram arrived since the network was joined
  std::uint32_t heard_ms_ = 0;
  UDPSocket socket_;  // non-blocking: the core's WiFiUDP can wait a second to send or to receive

  alignas(8) unsigned char stack_[stack_size];
  rtos::Thread thread_{osPriorityBelowNormal, stack_size, stack_, "r4-network"};
};

}  // namespace giga
}  // namespace r4
