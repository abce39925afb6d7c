// SPDX-License-Identifier: GPL-3.0-or-later
#include "ultrasonic.hpp"

namespace r4 {
namespace firmware {

void UltrasonicSensors::echo(int sensor, bool high, std::uint32_t at_us) {
  high_[sensor].store(high);
  if (listening_.load() != sensor) return;
  if (high && !rose_.load()) {
    rose_us_.store(at_us);
    rose_.store(true);
  } else if (!high && rose_.load() && !fell_.load()) {
    fell_us_.store(at_us);
    fell_.store(true);
  }
}

void UltrasonicSensors::poll(std::uint32_t now_us) {
  const std::uint32_t passed_us = now_us - began_us_;
  switch (phase_) {
    case Phase::waiting:
      begin_turn(now_us);
      return;
    case Phase::trigger:
      if (passed_us < trigger_us) return;
      trigger_[sensor_]->write(false);
      phase_ = Phase::listening;
      return;
    case Phase::listening: {
      if (fell_.load()) {
        const std::uint32_t length_us = fell_us_.load() - rose_us_.load();
        const std::uint32_t cm = length_us / us_per_cm;
        if (length_us >= echo_limit_us || cm > range_cm) {
          finish(EchoResult::no_echo, 0);
        } else {  // 0 would mean no obstacle
          finish(EchoResult::distance, static_cast<std::uint16_t>(cm > 0 ? cm : 1));
        }
      } else if (passed_us >= listen_us) {
        finish(rose_.load() ? EchoResult::no_echo : EchoResult::no_answer, 0);
      }
      return;
    }
    case Phase::done:
      if (passed_us >= cycle_us) begin_turn(now_us);
      return;
  }
}

void UltrasonicSensors::begin_turn(std::uint32_t now_us) {
  if ((fitted_ & 0x0F) == 0) return;
  do {
    sensor_ = (sensor_ + 1) % count;
  } while ((fitted_ >> sensor_ & 1) == 0);
  began_us_ = now_us;
  if (high_[sensor_].load()) {
    finish(EchoResult::line_stuck, 0);
    return;
  }
  rose_.store(false);
  fell_.store(false);
  listening_.store(sensor_);
  trigger_[sensor_]->write(true);
  phase_ = Phase::trigger;
}

void UltrasonicSensors::finish(EchoResult result, std::uint16_t cm) {
  listening_.store(-1);
  result_[sensor_] = result;
  distance_cm_[sensor_] = cm;
  phase_ = Phase::done;
}

}  // namespace firmware
}  // namespace r4
