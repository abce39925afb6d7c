// SPDX-License-Identifier: GPL-3.0-or-later
#include "udp_board.hpp"

#include <fmt/format.h>

#include "network/packet_address.hpp"
#include "search/host_lookup.hpp"

namespace r4 {
namespace {

constexpr int most_packets = 32;  // then other work of the loop runs

}  // namespace

void UdpBoard::open(Handler& handler) {
  close();
  const Endpoint local(address_of(HostLookup().find(url_.host), url_.host, url_.text), url_.port);
  if (!url_.peer_host.empty()) find_peer(local);
  open_socket(local, false);
  asio::error_code error;
  socket_.bind(local, error);
  if (error) refuse(error, local, "end that program, or listen on another port");
  if (local.address().is_unspecified()) note_addresses(socket_.native_handle(), local.protocol());
  name_ = fmt::format("udp://{}:{}", bracketed(url_.host), socket_.local_endpoint().port());
  if (!url_.peer.empty()) name_ += "?peer=" + url_.peer;
  begin(handler);
}

void UdpBoard::find_peer(const Endpoint& local) {
  const FoundHost found = HostLookup().find(url_.peer_host);
  Endpoint host(address_of(found, url_.peer_host, url_.text), url_.peer_port);
  const bool v6_socket = local.protocol() == asio::ip::udp::v6();
  if (v6_socket && host.protocol() == asio::ip::udp::v4()) {
    host.address(asio::ip::make_address_v6(asio::ip::v4_mapped, host.address().to_v4()));
  } else if (!v6_socket && host.protocol() == asio::ip::udp::v6()) {
    throw Error(ErrorKind::usage, url_.text, "an IPv4 socket cannot send to an IPv6 peer",
                "listen on [::]");
  }
  audience_ = HostAddresses{host, {}};
}

void UdpBoard::take_what_is_there() {
  for (int i = 0; i < most_packets && handler_ != nullptr; ++i) {
    const auto size = receive_packet(socket_.native_handle(), received_.data(), received_.size(),
                                     sender_, sent_to_);
    if (!size) {
      handler_->on_drained();
      break;
    }
    received({received_.data(), *size});
  }
  if (handler_ != nullptr) listen();
}

void UdpBoard::received(std::string_view bytes) {
  if (bytes.size() > max_datagram) {
    ++counters_.rx_oversize;
    return;
  }
  const Peer peer = peers_.heard({sender_, sent_to_}, bytes);
  follow_audience();
  hand_over(bytes, peer);
}

bool UdpBoard::reaches(Peer peer) const {
  const HostAddresses* const at = peers_.find(peer);
  return peer == everyone || (at != nullptr && audience_ && *at == *audience_);
}

void UdpBoard::follow_audience() {
  const HostAddresses* const audience = peers_.find(peers_.audience());
  if (audience != nullptr && url_.peer_host.empty()) audience_ = *audience;
}

SendResult UdpBoard::transmit(std::string_view bytes, Peer to) {
  const HostAddresses* const asker = to != everyone ? peers_.find(to)
                                     : audience_    ? &*audience_
                                                    : nullptr;
  if (asker == nullptr) {
    ++counters_.tx_dropped;
    return SendResult::down;
  }
  const SendResult outcome = transmit_to(bytes, asker->host, to == everyone, asker->at);
  if (outcome == SendResult::full) return outcome;
  // The paper's client listens at another port of its address.
  if (audience_ && !url_.peer_host.empty() && !peers_.watches(to) &&
      asker->host.address() == audience_->host.address() &&
      asker->host.port() != audience_->host.port()) {
    return transmit_to(bytes, audience_->host, true, asker->at);
  }
  return outcome;
}

}  // namespace r4
