// SPDX-License-Identifier: GPL-3.0-or-later
// The host's end of UDP: one board, which may be known by the name of its address, or by its own
// (board_search.hpp), and may move.
#pragma once

#include <asio/io_context.hpp>
#include <chrono>
#include <optional>

#include "network/network_watch.hpp"
#include "search/board_search.hpp"
#include "search/host_lookup.hpp"
#include "udp_crowd.hpp"
#include "udp_end.hpp"
#include "udp_gathering.hpp"

namespace r4 {

class UdpHost final : public UdpEnd, private UdpCrowd::Member, private NetworkWatch::Member {
 public:
  UdpHost(asio::io_context& io, const Url& url, HostLookup lookup, BoardSearch search);
  ~UdpHost() override { close(); }

  void open(Handler& handler) override;
  void close() noexcept override;
  void gather() override;
  std::optional<std::chrono::steady_clock::time_point> arrival() const override {
    return gathering_ ? gathering_->arrival() : std::nullopt;
  }

 private:
  void listen() override;
  void received(std::string_view bytes) override;
  void on_packet(std::string_view bytes, const Endpoint& from) override;
  void on_all_read() override { handler_->on_drained(); }
  Outcome transmit(std::string_view bytes, Peer to) override;
  int probe(const std::vector<OwnAddress>& own) override;
  void on_network_change(const std::vector<OwnAddress>& own) override;
  void close_socket() noexcept override;

  void bind(const Endpoint& board);
  void enter_crowd();
  void found(const FoundHost& answer);
  void remember(const FoundHost& answer);
  HostWatch::Question question() const;
  void watch();
  void take_what_has_gathered();

  const HostLookup lookup_;
  BoardSearch search_;
  WantedBoard wanted_;  // where the URL leaves it to a search
  HostWatch watch_;
  UdpHostSocket host_socket_{socket_};
  std::optional<UdpGathering> gathering_;  // of what comes; else it is read at once
  UdpCrowd& crowd_;
  NetworkWatch& network_;
  bool entered_ = false;  // the crowd, which counts it
  bool one_of_many_ = false;
  bool named_ = false;  // the URL has a name or leaves it to a search: where the board is, is asked
  Endpoint board_;
};

}  // namespace r4
