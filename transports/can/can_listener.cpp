// SPDX-License-Identifier: GPL-3.0-or-later
#include "can_listener.hpp"

#include <optional>
#include <utility>

#include "can_interface.hpp"

namespace r4 {

CanListener::CanListener(asio::io_context& io, const std::string& interface, CanBitRate rate)
    : survey_(rate), bus_(CanBus::of(io, interface, can_interface(interface).fd)) {
  bus_->join_all(*this);
}

CanListener::~CanListener() { bus_->leave(*this); }

void CanListener::on_event(std::function<void(const CarrierEvent&)> callback) {
  event_callback_ = std::move(callback);
  if (const std::optional<CarrierEvent> standing = bus_->standing()) on_bus(*standing);
}

void CanListener::on_bus(const CarrierEvent& event) {
  if (event_callback_) event_callback_(event);
}

}  // namespace r4
