// SPDX-License-Identifier: GPL-3.0-or-later
// The board's end of UDP: hosts come and go, and one of them is in control.
#pragma once

#include <asio/io_context.hpp>

#include "../framing/peer_table.hpp"
#include "search/host_lookup.hpp"
#include "udp_end.hpp"

namespace r4 {

class UdpBoard final : public UdpEnd {
 public:
  UdpBoard(asio::io_context& io, const Url& url, HostLookup lookup);
  ~UdpBoard() override { close(); }

  void open(Handler& handler) override;
  void close() noexcept override;
  void hold(Peer peer) override;
  void also_hold(Peer peer) override { peers_.also_hold(peer); }
  bool reaches(Peer peer) const override;

 private:
  void received(std::string_view bytes) override;
  Outcome transmit(std::string_view bytes, Peer to) override;
  int probe(const std::vector<OwnAddress>& own) override;
  void close_socket() noexcept override;

  void find_peer(const Endpoint& local);
  void follow_audience();

  static constexpr int peer_places = 16;

  const HostLookup lookup_;
  PeerTable<Endpoint, peer_places> peers_;
  bool audience_known_ = false;
  Endpoint audience_;  // where what is for everyone goes
};

}  // namespace r4
