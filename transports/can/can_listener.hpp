// SPDX-License-Identifier: GPL-3.0-or-later
// Listens to a CAN interface: every frame goes to a CanSurvey, and nothing is ever sent. What
// becomes of the interface is told as it is to a carrier.
#pragma once

#include <asio/io_context.hpp>
#include <functional>
#include <memory>
#include <string>

#include "can_bus.hpp"
#include "can_survey.hpp"
#include "r4link/carrier.hpp"

namespace r4 {

class CanListener final : private CanBus::Member {
 public:
  // `rate` is for the survey's sums. Throws Error, as a carrier does that is opened.
  CanListener(asio::io_context& io, const std::string& interface, CanBitRate rate);
  ~CanListener();
  CanListener(const CanListener&) = delete;
  CanListener& operator=(const CanListener&) = delete;

  CanSurvey& survey() { return survey_; }
  const CanSurvey& survey() const { return survey_; }
  // CAN FD frames came that switch their bit rate: the survey's sums need rate.data.
  bool heard_rate_switch() const { return bus_->heard_rate_switch(); }
  // Down, or warned of.
  bool in_trouble() const { return bus_->standing().has_value(); }
  // Also of what is the matter already.
  void on_event(std::function<void(const CarrierEvent&)> callback);

 private:
  void on_frame(const CanFrame& frame, std::uint32_t at_us) override {
    survey_.on_frame(frame, at_us);
  }
  void on_drained() override {}
  bool offer(std::uint32_t, CanFrame&) override { return false; }
  bool offer_urgent(std::uint32_t, CanFrame&) override { return false; }
  void frame_sent(std::uint32_t) override {}
  void on_sent() override {}
  void on_bus(const CarrierEvent& event) override;
  void on_stuck() override {}

  CanSurvey survey_;
  std::function<void(const CarrierEvent&)> event_callback_;
  std::shared_ptr<CanBus> bus_;
};

}  // namespace r4
