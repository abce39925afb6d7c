// SPDX-License-Identifier: GPL-3.0-or-later
// An HC-SR04 (data sheet): after a trigger, echo is high for 58 us/cm; 38 ms: no obstacle.
#pragma once

#include <cstdint>

#include "../../../../protocol/datagram/wrapping.hpp"
#include "pin_models.hpp"

namespace r4 {
namespace sim {

class UltrasonicModel {
 public:
  static constexpr std::uint32_t burst_us = 450;  // from the trigger's end to the echo line's rise
  static constexpr std::uint32_t us_per_cm = 58;
  static constexpr std::uint32_t nothing_us = 38000;

  OutputPinModel& trigger() { return trigger_; }
  void set_distance(std::uint16_t cm) { cm_ = cm; }
  std::uint16_t distance() const { return cm_; }
  void connect(bool connected) { connected_ = connected; }
  bool connected() const { return connected_; }

  // Reports the echo line's edges since the last call: on_edge(bool high, std::uint32_t at_us).
  template <class OnEdge>
  void pass(std::uint32_t now_us, OnEdge&& on_edge) {
    const bool fell = triggered_ && !trigger_.high();
    triggered_ = trigger_.high();
    if (fell && phase_ == Phase::quiet && connected_) {
      phase_ = Phase::burst;
      next_us_ = now_us + burst_us;
    }
    if (phase_ == Phase::burst && is_due(now_us)) {
      on_edge(true, next_us_);
      phase_ = Phase::echo;
      next_us_ += cm_ == 0 || cm_ * us_per_cm > nothing_us ? nothing_us : cm_ * us_per_cm;
    }
    if (phase_ == Phase::echo && is_due(now_us)) {
      on_edge(false, next_us_);
      phase_ = Phase::quiet;
    }
  }

 private:
  enum class Phase : std::uint8_t { quiet, burst, echo };

  // Also true if the clock restarted, because the microcontroller was reset.
  bool is_due(std::uint32_t now_us) const {
    return reached(now_us, next_us_) || next_us_ - now_us > nothing_us;
  }

  OutputPinModel trigger_;
  std::uint16_t cm_ = 0;
  bool connected_ = true;
  bool triggered_ = false;
  Phase phase_ = Phase::quiet;
  std::uint32_t next_us_ = 0;
};

}  // namespace sim
}  // namespace r4
