// SPDX-License-Identifier: GPL-3.0-or-later
// The hosts that have sent datagrams, and the receivers of a datagram to everyone, as in
// udp://BIND?peer=HOST (docs/reference/transports.md). Call from the network thread only.
#pragma once

#include <cstdint>

#include "../../../../transports/framing/peer_table.hpp"
#include "../../../port.hpp"

namespace r4 {
namespace giga {

struct UdpAddress {
  std::uint32_t ip = 0;  // a.b.c.d, a in the highest byte
  std::uint16_t port = 0;
  friend bool operator==(UdpAddress a, UdpAddress b) { return a.ip == b.ip && a.port == b.port; }
};

class UdpPeers {
 public:
  static constexpr int capacity = 16;
  static constexpr std::uint16_t host_port = 2390;  // where the paper's host program listens

  // The host at `ip` also gets datagrams to everyone, at host_port; 0: none.
  void set_host(std::uint32_t ip) { host_ = ip; }

  // Returns the number of the sender; everyone if `bytes` is not a valid datagram.
  std::uint32_t heard(UdpAddress from, Text bytes) { return hosts_.heard(from, bytes); }
  void hold(std::uint32_t peer) { hosts_.hold(peer); }
  void also_hold(std::uint32_t peer) { hosts_.also_hold(peer); }

  static constexpr int most_places = 2;
  int find(std::uint32_t peer, UdpAddress (&to)[most_places]) const {
    to[1].ip = host_;
    to[1].port = host_port;
    if (peer == everyone && host_ != 0) {
      to[0] = to[1];
      return 1;
    }
    const UdpAddress* const at = hosts_.find(peer == everyone ? hosts_.audience() : peer);
    if (at == nullptr) return 0;
    to[0] = *at;
    // The paper's host program sends from another port than it listens on.
    return at->ip == host_ && at->port != host_port && !hosts_.watches(peer) ? 2 : 1;
  }

 private:
  using Hosts = PeerTable<UdpAddress, capacity>;
  static_assert(Hosts::nobody == everyone, "numbers go through unchanged");
  Hosts hosts_;
  std::uint32_t host_ = 0;
};

}  // namespace giga
}  // namespace r4
