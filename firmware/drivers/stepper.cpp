// SPDX-License-Identifier: GPL-3.0-or-later
#include "stepper.hpp"

namespace r4 {
namespace firmware {

void Stepper::go(std::int32_t position, std::int32_t speed) {
  if (target_.load(std::memory_order_relaxed) != position) {
    stop();  // tick() must not see the new target with the old speed
    target_.store(position, std::memory_order_relaxed);
  }
  const std::int32_t limited = speed < limit_ ? speed : limit_;
  speed_.store(limited > 0 ? limited : 0, std::memory_order_relaxed);
}

void Stepper::zero() {
  stop();
  position_.store(0, std::memory_order_relaxed);
  target_.store(0, std::memory_order_relaxed);
}

void Stepper::tick() {
  if (pulse_) {
    step_.write(false);
    pulse_ = false;
  }
  const std::int32_t speed = speed_.load(std::memory_order_relaxed);
  const std::int32_t position = position_.load(std::memory_order_relaxed);
  // The distance wraps like the positions, so the motor turns in the shorter direction.
  const auto distance = static_cast<std::int32_t>(
      static_cast<std::uint32_t>(target_.load(std::memory_order_relaxed)) -
      static_cast<std::uint32_t>(position));
  if (speed == 0 || distance == 0) {
    part_ = 0;
    return;
  }
  const Heading heading = distance > 0 ? Heading::forward : Heading::backward;
  if (heading != heading_) {
    heading_ = heading;
    direction_.write((heading == Heading::forward) != low_is_forward_);
    part_ = 0;
    return;
  }
  part_ += speed;
  if (part_ < tick_hz_) return;
  part_ -= tick_hz_;
  step_.write(true);
  pulse_ = true;
  const std::uint32_t one_more = heading == Heading::forward ? 1U : 0xFFFFFFFFU;
  position_.store(static_cast<std::int32_t>(static_cast<std::uint32_t>(position) + one_more),
                  std::memory_order_relaxed);
}

}  // namespace firmware
}  // namespace r4
