// SPDX-License-Identifier: GPL-3.0-or-later
// Numbers for the hosts that have sent to the board's socket, and where what is for everyone goes
// (docs/transports.md, as udp://BIND?peer=HOST does it). A number is never given twice. A new sender
// takes the place of the one that has been silent longest or, while all have been heard within
// idle_ms, of the one heard least often: a flood from changing addresses pushes no working host out.
// Of the network thread alone.
#pragma once

#include <cstdint>

#include "../../port.hpp"

namespace r4 {
namespace giga {

struct UdpAddress {
  std::uint32_t ip = 0;  // a.b.c.d, a in the highest byte
  std::uint16_t port = 0;
  friend bool operator==(UdpAddress a, UdpAddress b) { return a.ip == b.ip && a.port == b.port; }
};

class UdpPeers {
 public:
  static constexpr int capacity = 8;
  static constexpr std::uint32_t idle_ms = 2000;
  static constexpr std::uint16_t host_port = 2390;  // where the paper's client listens

  // A host that gets what is for everyone, at host_port; 0: none.
  void set_host(std::uint32_t ip) { host_ = ip; }

  // The number of whoever has just been heard.
  std::uint32_t heard(UdpAddress from, std::uint32_t now_ms) {
    Entry* place = nullptr;
    for (Entry& entry : entries_) {
      if (entry.number != firmware::everyone && entry.address == from) place = &entry;
    }
    if (place == nullptr) {
      place = &place_for_new(now_ms);
      *place = Entry();
      place->address = from;
      place->number = ++given_;
    }
    place->heard_ms = now_ms;
    ++place->datagrams;
    last_ = place->number;
    return place->number;
  }

  // Where to send what is for `peer`. False: nowhere.
  bool find(std::uint32_t peer, UdpAddress& to) const {
    if (peer == firmware::everyone && host_ != 0) {
      to.ip = host_;
      to.port = host_port;
      return true;
    }
    const std::uint32_t number = peer == firmware::everyone ? last_ : peer;
    for (const Entry& entry : entries_) {
      if (number == firmware::everyone || entry.number != number) continue;
      to = entry.address;
      if (to.ip == host_) to.port = host_port;  // it asks from another port than it listens at
      return true;
    }
    return false;
  }

 private:
  struct Entry {
    UdpAddress address;
    std::uint32_t number = firmware::everyone;  // everyone: free
    std::uint32_t heard_ms = 0;
    std::uint32_t datagrams = 0;
  };

  // A free place; that of the one silent longest, if that is long; else of the one heard least.
  Entry& place_for_new(std::uint32_t now_ms) {
    Entry* silent = &entries_[0];
    Entry* seldom = &entries_[0];
    for (Entry& entry : entries_) {
      if (entry.number == firmware::everyone) return entry;
      if (now_ms - entry.heard_ms > now_ms - silent->heard_ms) silent = &entry;
      if (entry.datagrams < seldom->datagrams) seldom = &entry;
    }
    return now_ms - silent->heard_ms >= idle_ms ? *silent : *seldom;
  }

  Entry entries_[capacity];
  std::uint32_t given_ = 0;
  std::uint32_t last_ = firmware::everyone;
  std::uint32_t host_ = 0;
};

}  // namespace giga
}  // namespace r4
