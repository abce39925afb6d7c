// SPDX-License-Identifier: GPL-3.0-or-later
// The emergency stop of a CAN bus, which every board of the bus obeys. Its frames overtake all
// frames that wait in the queue of the interface. CanBus owns one object, so that several members
// press one stop.
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
  // Announcements within this time share a number. It is shorter than the time for which a host
  // repeats a confirmed stop, so a host that clears the stop meanwhile finds it pressed again.
  static constexpr std::chrono::milliseconds together{100};

  BusStops(asio::io_context& io, CanMedium& medium);

  // Sends the frame without a number, which boards of every version of the id plan obey. A board
  // takes each such frame for a new stop.
  SendResult send_bare();
  // Sends the bare frame of a stop that is to be confirmed, and sets `number` for repeat(). Members
  // that announce a stop in one turn of the loop, within `together`, get one number, and one bare
  // frame is sent. A member whose own earlier stop (`own`) has that number gets a new number.
  SendResult announce(const StopNumbers& own, std::uint32_t& number);
  // Sends the frame with that number, if it was not sent within `spacing`.
  SendResult repeat(std::uint32_t number);

 private:
  using Clock = CanMedium::Clock;
  SendResult send_first(const CanFrame& frame);

  asio::io_context& io_;
  CanMedium& medium_;
  std::uint32_t announced_;  // the newest number
  Clock::time_point announced_at_;
  bool announcing_ = false;  // in this turn of the loop
  OperationSlot announcement_;
  std::optional<std::uint32_t> repeated_;  // the number that was sent last
  Clock::time_point repeated_at_;
};

}  // namespace r4
