// SPDX-License-Identifier: GPL-3.0-or-later
// Up to four HC-SR04 sensors, in turn so that no sensor receives another's burst. Data sheet:
// trigger at least 10 us, echo 58 us/cm, about 38 ms without echo, at least 60 ms between triggers.
//           poll()                 10 us later           echo fell, or 40 ms passed
//     waiting ----------> trigger ------------> listening ----------> done
//        ^                                                              |
//        +---------------- 60 ms after the trigger: next sensor --------+
//
// Each of four sensors is read about four times a second. An interrupt calls echo(). Poll each ms.
#pragma once

#include <atomic>
#include <cstdint>

#include "pins.hpp"

namespace r4 {
namespace firmware {

enum class EchoResult : std::uint8_t {
  none_yet,
  distance,    // distance_cm() is valid
  no_echo,     // nothing within range
  no_answer,   // the echo line never rose: no sensor, or a broken sensor
  line_stuck,  // the echo line was high before the trigger
};

class UltrasonicSensors {
 public:
  static constexpr int count = 4;
  static constexpr std::uint32_t trigger_us = 10;
  static constexpr std::uint32_t echo_limit_us = 38000;
  static constexpr std::uint32_t listen_us = 40000;
  static constexpr std::uint32_t cycle_us = 60000;
  static constexpr std::uint32_t us_per_cm = 58;
  static constexpr std::uint16_t range_cm = 400;

  // Bit n of `fitted`: sensor n is fitted; a missing sensor gets no turn.
  UltrasonicSensors(OutputPin& trigger_0, OutputPin& trigger_1, OutputPin& trigger_2,
                    OutputPin& trigger_3, std::uint8_t fitted)
      : trigger_{&trigger_0, &trigger_1, &trigger_2, &trigger_3}, fitted_(fitted) {}

  void poll(std::uint32_t now_us);
  // The echo line of sensor 0-3 changed to `high` at `at_us`.
  void echo(int sensor, bool high, std::uint32_t at_us);

  // Centimetres, 1-400; 0: nothing in range, or unknown.
  std::uint16_t distance_cm(int sensor) const { return distance_cm_[sensor]; }
  EchoResult result(int sensor) const { return result_[sensor]; }
  bool sees(int sensor) const {
    return result_[sensor] == EchoResult::distance || result_[sensor] == EchoResult::no_echo;
  }

 private:
  enum class Phase : std::uint8_t { waiting, trigger, listening, done };

  void begin_turn(std::uint32_t now_us);
  void finish(EchoResult result, std::uint16_t cm);

  OutputPin* trigger_[count];
  std::uint8_t fitted_;
  Phase phase_ = Phase::waiting;
  int sensor_ = count - 1;
  std::uint32_t began_us_ = 0;
  std::uint16_t distance_cm_[count] = {};
  EchoResult result_[count] = {};
  std::atomic<bool> high_[count] = {};
  std::atomic<bool> rose_{false};
  std::atomic<bool> fell_{false};
  std::atomic<int> listening_{-1};
  std::atomic<std::uint32_t> rose_us_{0};
  std::atomic<std::uint32_t> fell_us_{0};
};

}  // namespace firmware
}  // namespace r4
