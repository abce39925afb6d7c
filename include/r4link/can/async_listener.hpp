// SPDX-License-Identifier: GPL-3.0-or-later
// Listens to a CAN interface: every frame goes to a CanSurvey, and nothing is sent. A CanListener
// reports the events of the interface as a carrier does. With r4link::asio only.
//     asio::io_context io;
//     r4::CanListener bus(io, "can0", {1000000, 0});
//     bus.survey().on_datagram([](std::uint8_t node, const r4::Datagram& datagram) { … });
//     io.run();
#pragma once

#include <asio/io_context.hpp>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "../carrier.hpp"
#include "can_survey.hpp"

namespace r4 {

class CanListener {
 public:
  // `rate` is for the survey's sums. Throws Error as a carrier's open() does.
  CanListener(asio::io_context& io, const std::string& interface, CanBitRate rate);
  ~CanListener();
  CanListener(const CanListener&) = delete;
  CanListener& operator=(const CanListener&) = delete;

  CanSurvey& survey();
  const CanSurvey& survey() const;
  // The clock of the survey's frames, in microseconds; wraps.
  static std::uint32_t now_us();
  // True if CAN FD frames with a switched bit rate arrived: the survey's sums need rate.data.
  bool heard_rate_switch() const;
  // True while the interface is down or a warning applies.
  bool in_trouble() const;
  // An event that already applies is reported at once.
  void on_event(std::function<void(const CarrierEvent&)> callback);

 private:
  class Member;
  std::unique_ptr<Member> member_;
};

}  // namespace r4
