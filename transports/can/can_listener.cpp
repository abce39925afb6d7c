// SPDX-License-Identifier: GPL-3.0-or-later
#include <optional>
#include <utility>

#include "can_bus.hpp"
#include "r4link/can/async_listener.hpp"
#include "r4link/can/can_interface.hpp"

namespace r4 {

class CanListener::Member final : private CanBus::Member {
 public:
  Member(asio::io_context& io, const std::string& interface, CanBitRate rate)
      : survey(rate), bus(CanBus::of(io, interface, can_interface(interface).fd)) {
    bus->join_all(*this);
  }
  ~Member() { bus->leave(*this); }

  void on_bus(const CarrierEvent& event) override {
    if (event_callback) event_callback(event);
  }

  CanSurvey survey;
  std::function<void(const CarrierEvent&)> event_callback;
  std::shared_ptr<CanBus> bus;

 private:
  void on_frame(const CanFrame& frame, std::uint32_t at_us) override {
    survey.on_frame(frame, at_us);
  }
};

CanListener::CanListener(asio::io_context& io, const std::string& interface, CanBitRate rate)
    : member_(std::make_unique<Member>(io, interface, rate)) {}
CanListener::~CanListener() = default;

CanSurvey& CanListener::survey() { return member_->survey; }
const CanSurvey& CanListener::survey() const { return member_->survey; }

std::uint32_t CanListener::now_us() { return CanBus::now_us(); }

bool CanListener::heard_rate_switch() const { return member_->bus->heard_rate_switch(); }

bool CanListener::in_trouble() const { return member_->bus->standing().has_value(); }

void CanListener::on_event(std::function<void(const CarrierEvent&)> callback) {
  member_->event_callback = std::move(callback);
  if (const std::optional<CarrierEvent> standing = member_->bus->standing()) {
    member_->on_bus(*standing);
  }
}

}  // namespace r4
