// SPDX-License-Identifier: GPL-3.0-or-later
// Listens to a CAN interface: every frame goes to a CanSurvey, and nothing is ever sent. It reports
// the events of the interface as a carrier does.
#pragma once

#include <asio/io_context.hpp>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "can_bus.hpp"
#include "can_interface.hpp"
#include "can_survey.hpp"
#include "r4link/carrier.hpp"

namespace r4 {

class CanListener final : private CanBus::Member {
 public:
  // `rate` is for the survey's sums. Throws Error, as a carrier's open() does.
  CanListener(asio::io_context& io, const std::string& interface, CanBitRate rate)
      : survey_(rate), bus_(CanBus::of(io, interface, can_interface(interface).fd)) {
    bus_->join_all(*this);
  }
  ~CanListener() { bus_->leave(*this); }
  CanListener(const CanListener&) = delete;
  CanListener& operator=(const CanListener&) = delete;

  CanSurvey& survey() { return survey_; }
  const CanSurvey& survey() const { return survey_; }
  // True if CAN FD frames came that switch their bit rate: the survey's sums need rate.data.
  bool heard_rate_switch() const { return bus_->heard_rate_switch(); }
  // True while the interface is down, or a warning stands.
  bool in_trouble() const { return bus_->standing().has_value(); }
  // An event that is true already is reported at once.
  void on_event(std::function<void(const CarrierEvent&)> callback) {
    event_callback_ = std::move(callback);
    if (const std::optional<CarrierEvent> standing = bus_->standing()) on_bus(*standing);
  }

 private:
  void on_frame(const CanFrame& frame, std::uint32_t at_us) override {
    survey_.on_frame(frame, at_us);
  }
  void on_bus(const CarrierEvent& event) override {
    if (event_callback_) event_callback_(event);
  }

  CanSurvey survey_;
  std::function<void(const CarrierEvent&)> event_callback_;
  std::shared_ptr<CanBus> bus_;
};

}  // namespace r4
