// SPDX-License-Identifier: GPL-3.0-or-later
// Ethernet, ARP, IPv4 and UDP for one port and a static address (RFC 826, 791, 768), without I/O.
// Answers ARP. No fragments, no sent options, no routing: all hosts are in the board's /16.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "r4link/datagram.hpp"

namespace r4 {
namespace m7 {

struct Mac {
  std::uint8_t bytes[6] = {};
};

struct UdpAddress {
  Mac mac;
  std::uint16_t host = 0;  // host part of the IP address; 0: none
  std::uint16_t port = 0;
  friend bool operator==(const UdpAddress& a, const UdpAddress& b) {
    return a.host == b.host && a.port == b.port &&
           std::memcmp(a.mac.bytes, b.mac.bytes, sizeof a.mac.bytes) == 0;
  }
};

class UdpFrames {
 public:
  // The UDP data of a frame, unchecked; empty if the frame is not UDP.
  static Text peek(const std::uint8_t* frame, std::size_t size);
  static constexpr std::size_t head_size = 14 + 20 + 8;
  static constexpr std::size_t max_frame = head_size + max_datagram;
  static constexpr std::size_t min_frame = 60;

  // 10.0.2.15 is `address` 0x0A00020F.
  UdpFrames(std::uint32_t address, std::uint16_t port) : address_(address), port_(port) {}
  void set_mac(const Mac& mac) { mac_ = mac; }

  struct Arrival {
    UdpAddress from;             // host 0: no datagram
    Text datagram;               // in the frame
    std::size_t reply_size = 0;  // size of a frame to send back at once
  };
  // `frame` without its check sequence. `reply` has room for min_frame bytes.
  Arrival take(const std::uint8_t* frame, std::size_t size, std::uint8_t* reply);

  // Writes the frame with `datagram` for `to` and returns its size; 0: the datagram is too long.
  std::size_t write(const UdpAddress& to, Text datagram, std::uint8_t* frame);

  std::uint32_t bad() const { return bad_; }  // wrong checksum or length

 private:
  std::size_t answer_arp(const std::uint8_t* frame, std::size_t size, std::uint8_t* reply);
  bool is_neighbour(std::uint32_t address) const { return (address ^ address_) >> 16 == 0; }

  const std::uint32_t address_;
  const std::uint16_t port_;
  Mac mac_;
  std::uint16_t identification_ = 0;
  std::uint32_t bad_ = 0;
};

}  // namespace m7
}  // namespace r4
