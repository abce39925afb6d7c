// SPDX-License-Identifier: GPL-3.0-or-later
// The host's end of UDP: one board, which may move, given by address, host name or board name.
#pragma once

#include <asio/io_context.hpp>

#include "../share_name.hpp"
#include "network/network_watch.hpp"
#include "search/board_search.hpp"
#include "search/host_lookup.hpp"
#include "udp_end.hpp"

namespace r4 {

class UdpHost final : public UdpEnd, private NetworkWatch::Member {
 public:
  UdpHost(asio::io_context& io, const Url& url, Claim claim, HostLookup lookup = {},
          BoardSearch search = {});
  ~UdpHost() override { close(); }

  void open(Handler& handler) override;
  void close() noexcept override;

 private:
  void listen() override;
  void received(std::string_view bytes);
  SendResult transmit(std::string_view bytes, Peer) override {
    return transmit_to(bytes, board_, true);
  }
  int probe(const std::vector<OwnAddress>& own) override;
  void on_network_change(const std::vector<OwnAddress>& own) override { check_network(own); }
  void close_socket() noexcept override { host_socket_.close(); }

  void bind(const Endpoint& board);
  void found(const FoundHost& answer);
  HostWatch::Question question() const;

  const HostLookup lookup_;
  BoardSearch search_;
  const Claim claim_;
  WantedBoard wanted_;  // of a search: the board that was found, even if other boards answer
  HostWatch watch_;
  UdpHostSocket host_socket_{socket_};
  NetworkWatch& network_;
  bool named_ = false;  // the address of the board is from a lookup or a search
  Endpoint board_;
};

}  // namespace r4
