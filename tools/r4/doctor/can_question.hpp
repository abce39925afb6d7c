// SPDX-License-Identifier: GPL-3.0-or-later
// If no other host is heard on a CAN bus, requests a board's identity: all hosts get the answer.
#pragma once

#include <asio/io_context.hpp>
#include <chrono>
#include <memory>
#include <optional>
#include <string_view>

#include "../boards/timer.hpp"
#include "r4link/carrier.hpp"
#include "r4link/datagram.hpp"

namespace r4::tool {

class CanQuestion final : private Carrier::Handler {
 public:
  // Repeats the question until an answer arrives. Throws Error if the bus cannot be opened.
  CanQuestion(asio::io_context& io, std::string_view url);
  ~CanQuestion() { carrier_->close(); }
  CanQuestion(const CanQuestion&) = delete;
  CanQuestion& operator=(const CanQuestion&) = delete;

  void hear(const Datagram& datagram);
  // From question to answer; 0: no answer yet.
  double answer_us() const { return answer_us_; }
  // Seconds since the first question; 0: none was sent.
  double asked_since_s() const;
  TransportTrouble trouble() const { return trouble_; }

 private:
  using Clock = std::chrono::steady_clock;
  void ask();
  void on_datagram(std::string_view, Peer) override {}
  void on_carrier_event(const CarrierEvent&) override {}

  std::unique_ptr<Carrier> carrier_;
  Timer timer_;
  std::optional<Clock::time_point> first_asked_;
  std::optional<Clock::time_point> asked_;
  double answer_us_ = 0;
  TransportTrouble trouble_ = TransportTrouble::none;
};

}  // namespace r4::tool
