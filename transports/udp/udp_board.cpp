// SPDX-License-Identifier: GPL-3.0-or-later
#include "udp_board.hpp"

#include <fmt/core.h>

#include <utility>

namespace r4 {
namespace {

asio::ip::address mapped_to_v6(const asio::ip::address& address) {
  return asio::ip::make_address_v6(asio::ip::v4_mapped, address.to_v4());
}

}  // namespace

UdpBoard::UdpBoard(asio::io_context& io, const Url& url, HostLookup lookup)
    : UdpEnd(io, UdpUrl(url, Role::board)), lookup_(std::move(lookup)) {}

void UdpBoard::open(Handler& handler) {
  close();
  const Endpoint local(lookup_.find(url_.host, url_.text), url_.port);
  if (!url_.peer_host.empty()) find_peer(local);
  open_socket(local, false);
  asio::error_code error;
  socket_.bind(local, error);
  if (error) refuse(error, local, "end that program, or listen on another port");
  name_ = fmt::format("udp://{}:{}", bracketed(url_.host), socket_.local_endpoint().port());
  if (!url_.peer.empty()) name_ += "?peer=" + url_.peer;
  begin(handler);
}

void UdpBoard::find_peer(const Endpoint& local) {
  audience_ = Endpoint(lookup_.find(url_.peer_host, url_.text), url_.peer_port);
  const bool v6_socket = local.protocol() == asio::ip::udp::v6();
  if (v6_socket && audience_.protocol() == asio::ip::udp::v4()) {
    audience_.address(mapped_to_v6(audience_.address()));
  } else if (!v6_socket && audience_.protocol() == asio::ip::udp::v6()) {
    throw Error(ErrorKind::usage, url_.text, "an IPv4 socket cannot send to an IPv6 peer",
                "listen on [::]");
  }
  audience_known_ = true;
}

void UdpBoard::close() noexcept {
  audience_known_ = false;
  UdpEnd::close();
}

void UdpBoard::close_socket() noexcept {
  asio::error_code ignored;
  socket_.close(ignored);
}

void UdpBoard::received(std::string_view bytes) {
  if (bytes.size() > max_datagram) {
    ++counters_.rx_oversize;
    return;
  }
  const Peer peer = peers_.heard(sender_, bytes);
  follow_audience();
  hand_over(bytes, peer);
}

void UdpBoard::hold(Peer peer) {
  peers_.hold(peer);
  follow_audience();
}

bool UdpBoard::reaches(Peer peer) const {
  const Endpoint* const at = peers_.find(peer);
  return peer == everyone || (at != nullptr && audience_known_ && *at == audience_);
}

void UdpBoard::follow_audience() {
  const Endpoint* const audience = peers_.find(peers_.audience());
  if (audience == nullptr || !url_.peer_host.empty()) return;
  audience_ = *audience;
  audience_known_ = true;
}

UdpEnd::Outcome UdpBoard::transmit(std::string_view bytes, Peer to) {
  if (to == everyone) {
    if (audience_known_) return transmit_to(bytes, audience_, true);
    ++counters_.tx_dropped;
    return Outcome::failed;
  }
  const Endpoint* const asker = peers_.find(to);
  if (asker == nullptr) {
    ++counters_.tx_dropped;
    return Outcome::failed;
  }
  const Outcome outcome = transmit_to(bytes, *asker, false);
  if (outcome == Outcome::busy) return outcome;
  const bool same_machine =
      !url_.peer_host.empty() && asker->address() == audience_.address() && !peers_.watches(to);
  if (same_machine && asker->port() != audience_.port()) {
    return transmit_to(bytes, audience_, true);
  }
  return outcome;
}

int UdpBoard::probe(const std::vector<OwnAddress>& own) { return probe_route(audience_, {}, own); }

}  // namespace r4
