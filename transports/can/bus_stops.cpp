// SPDX-License-Identifier: GPL-3.0-or-later
#include "bus_stops.hpp"

#include <asio/post.hpp>
#include <random>

#include "r4link/can/can_ids.hpp"

namespace r4 {

BusStops::BusStops(asio::io_context& io, CanMedium& medium)
    : io_(io), medium_(medium), announced_(std::random_device{}()) {}

SendResult BusStops::send_bare() {
  CanFrame frame{};
  frame.id = emergency_stop_id;
  return send_first(frame);
}

SendResult BusStops::announce(const StopNumbers& own, std::uint32_t& number) {
  const Clock::time_point now = Clock::now();
  if (!announcing_ || now - announced_at_ >= together || own.carries(announced_)) {
    const SendResult bare = send_bare();
    if (bare != SendResult::sent) return bare;
    announced_ = short_stop_number(announced_ + 1);
    announced_at_ = now;
    announcing_ = true;
    asio::post(io_, announcement_.handler([this] { announcing_ = false; }));
  }
  number = announced_;
  return SendResult::sent;
}

SendResult BusStops::repeat(std::uint32_t number) {
  const Clock::time_point now = Clock::now();
  if (repeated_ == number && now - repeated_at_ < spacing) return SendResult::sent;
  CanFrame frame{};
  frame.extended = true;
  frame.id = numbered_stop_id(number);
  const SendResult result = send_first(frame);
  if (result == SendResult::sent) {
    repeated_ = number;
    repeated_at_ = now;
  }
  return result;
}

SendResult BusStops::send_first(const CanFrame& frame) {
  if (medium_.number() < 0) return SendResult::down;
  const CanMedium::Outcome outcome = medium_.send_first(frame);
  if (outcome == CanMedium::Outcome::done) return SendResult::sent;
  return outcome == CanMedium::Outcome::failed ? SendResult::down : SendResult::full;
}

}  // namespace r4
