// SPDX-License-Identifier: GPL-3.0-or-later
// The emergency stop of a CAN bus, shared by the members of a CanBus. Overtakes all waiting frames.
#pragma once

#include <asio/io_context.hpp>
#include <chrono>
#include <cstdint>
#include <optional>

#include "../operation_slot.hpp"
#include "can_medium.hpp"
#include "r4link/carrier.hpp"
#include "stop_numbers.hpp"

namespace r4 {

class BusStops {
 public:
  // The shortest time between two frames with the same number.
  static constexpr std::chrono::milliseconds spacing{10};
  // Announcements within this time share a number. A host repeats a stop for longer, so a further
  // stop takes effect even if a host clears the first stop meanwhile.
  static constexpr std::chrono::milliseconds together{100};

  BusStops(asio::io_context& io, CanMedium& medium);

  // Sends the frame without a number. Boards of all versions obey it, each time as a new stop.
  SendResult send_bare();
  // Sends a stop's bare frame, and sets `number` for repeat(). If `own` has no earlier stop with
  // that number, stops of one turn, within `together`, share frame and number.
  SendResult announce(const StopNumbers& own, std::uint32_t& number);
  // If the frame with that number was not sent within `spacing`, sends the frame.
  SendResult repeat(std::uint32_t number);

 private:
  using Clock = CanMedium::Clock;
  SendResult send_first(const CanFrame& frame);

  asio::io_context& io_;
  CanMedium& medium_;
  std::uint32_t announced_;
  Clock::time_point announced_at_;
  bool announcing_ = false;  // in this turn of the loop
  OperationSlot announcement_;
  std::optional<std::uint32_t> repeated_;
  Clock::time_point repeated_at_;
};

}  // namespace r4
