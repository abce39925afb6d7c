// SPDX-License-Identifier: GPL-3.0-or-later
// The board's end of UDP, with several hosts, of which one is in control. At 0.0.0.0 or [::] an
// answer leaves from the address to which the host has sent.
#pragma once

#include <asio/io_context.hpp>
#include <optional>

#include "../board_end.hpp"
#include "../framing/peer_table.hpp"
#include "udp_end.hpp"

namespace r4 {

class UdpBoard final : public UdpEnd, public BoardEnd {
 public:
  UdpBoard(asio::io_context& io, const Url& url) : UdpEnd(io, UdpUrl(url, Role::board)) {}
  ~UdpBoard() override { close(); }

  void open(Handler& handler) override;
  void close() noexcept override {
    audience_.reset();
    UdpEnd::close();
  }
  void hold(Peer peer) override {
    peers_.hold(peer);
    follow_audience();
  }
  void also_hold(Peer peer) override { peers_.also_hold(peer); }
  bool reaches(Peer peer) const override;

 private:
  // `at`: the own address to which the host sends; unspecified if the socket has one address only.
  struct HostAddresses {
    Endpoint host;
    asio::ip::address at;
    friend bool operator==(const HostAddresses&, const HostAddresses&) = default;
  };

  void listen() override {
    socket_.async_wait(UdpSocket::wait_read, reception_.handler([this] { take_what_is_there(); }));
  }
  void take_what_is_there();
  void received(std::string_view bytes);
  SendResult transmit(std::string_view bytes, Peer to) override;
  int probe(const std::vector<OwnAddress>& own) override {
    return probe_route(audience_ ? audience_->host : Endpoint(), {}, own);
  }

  void find_peer(const Endpoint& local);
  void follow_audience();

  static constexpr int peer_places = 16;

  PeerTable<HostAddresses, peer_places> peers_;
  asio::ip::address sent_to_;              // destination of the packet that is being read
  std::optional<HostAddresses> audience_;  // the destination of datagrams for everyone
};

}  // namespace r4
