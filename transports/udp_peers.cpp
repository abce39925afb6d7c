// SPDX-License-Identifier: GPL-3.0-or-later
#include "udp_peers.hpp"

#include <algorithm>

namespace r4 {

Peer UdpPeers::heard(const Endpoint& from, Time now) {
  for (Entry& entry : entries_) {
    if (entry.number != everyone && entry.endpoint == from) {
      entry.heard = now;
      ++entry.datagrams;
      return entry.number;
    }
  }
  if (++given_ == everyone) ++given_;
  place_for_new(now) = Entry{from, given_, now, 1};
  return given_;
}

const UdpPeers::Endpoint* UdpPeers::find(Peer number) const {
  for (const Entry& entry : entries_) {
    if (entry.number == number) return &entry.endpoint;
  }
  return nullptr;
}

UdpPeers::Entry& UdpPeers::place_for_new(Time now) {
  const auto longest_silent =
      std::min_element(entries_.begin(), entries_.end(),
                       [](const Entry& a, const Entry& b) { return a.heard < b.heard; });
  if (longest_silent->number == everyone || now - longest_silent->heard >= idle) {
    return *longest_silent;
  }
  return *std::min_element(entries_.begin(), entries_.end(), [](const Entry& a, const Entry& b) {
    return a.datagrams < b.datagrams;
  });
}

}  // namespace r4
