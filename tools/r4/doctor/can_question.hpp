// SPDX-License-Identifier: GPL-3.0-or-later
// Asks one board on a CAN bus who it is, as a host that comes to the bus does: only while no other
// host is heard. What it answers everyone on the bus hears.
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
  // Asks until the board has answered. Throws Error if the bus cannot be opened.
  CanQuestion(asio::io_context& io, std::string_view url);
  ~CanQuestion() { carrier_->close(); }
  CanQuestion(const CanQuestion&) = delete;
  CanQuestion& operator=(const CanQuestion&) = delete;

  // A datagram of the board.
  void hear(const Datagram& datagram);
  // Question to answer; 0: there was none.
  double answer_us() const { return answer_us_; }
  // How long ago the first question went out; 0: none did.
  double asked_since_s() const;
  // What stands in the way, at its worst.
  TransportTrouble trouble() const { return trouble_; }

 private:
  using Clock = std::chrono::steady_clock;
  void ask();
  void on_datagram(std::string_view, Peer) override {}
  void on_carrier_event(const CarrierEvent&) override {}

  std::unique_ptr<Carrier> carrier_;
  Timer timer_;
  std::optional<Clock::time_point> first_asked_;
  std::optional<Clock::time_point> asked_;  // the newest question that is not answered
  double answer_us_ = 0;
  TransportTrouble trouble_ = TransportTrouble::none;
};

}  // namespace r4::tool
