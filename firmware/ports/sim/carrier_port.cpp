// SPDX-License-Identifier: GPL-3.0-or-later
#include "carrier_port.hpp"

#include <utility>

namespace r4::sim {

CarrierPort::CarrierPort(std::unique_ptr<Carrier> carrier, Owner& owner)
    : carrier_(std::move(carrier)), end_(board_end_of(*carrier_)), owner_(owner) {}

void CarrierPort::send(Text datagram, Priority priority, Peer peer) {
  carrier_->send({datagram.data(), datagram.size()}, priority, peer);  // the carrier counts drops
}

void CarrierPort::on_datagram(std::string_view bytes, Peer from) {
  owner_.on_datagram(*this, from, bytes);
}

void CarrierPort::on_drained() { owner_.on_drained(*this); }

void CarrierPort::on_carrier_event(const CarrierEvent& event) {
  owner_.on_carrier_event(*this, event);
}

}  // namespace r4::sim
