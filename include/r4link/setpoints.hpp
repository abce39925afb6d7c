// SPDX-License-Identifier: GPL-3.0-or-later
// r4::Setpoints: output commands that a board executes together, in one pass over its chips, or none of
// them.
//
//     board.apply(r4::Setpoints{}.osmc(1, 358, forward).osmc(2, 358, forward).servo(3, 1500));
//
// Its effect is that of its commands one after the other, in the order in which they were added, with
// nothing in between: relay 1, closed behind a motor's command, takes that back (docs/safety.md). What is in
// it can be sent: a value outside its range, a second command for the same channel, and more than
// max_group of them throw Error{usage} as they are added.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "command.hpp"
#include "config.hpp"

namespace r4 {

class R4LINK_API Setpoints {
 public:
  // Channels count from 1; ranges as of the channels of Board.
  Setpoints& osmc(int channel, int pwm, Direction direction);
  Setpoints& dhb12(int channel, int pwm, Direction direction);
  Setpoints& servo(int channel, int pulse_us);
  Setpoints& relay(int channel, bool on);
  Setpoints& stepper(int channel, std::int32_t position, int speed = stepper_speed_default);
  Setpoints& zero(int channel);
  Setpoints& bldc(int channel, int speed, Direction direction, bool brake = false);
  // A voltage, 0-3300 mV.
  Setpoints& dac(int channel, int millivolts);
  // Any output command (O D S R P B Z, X:DAC).
  Setpoints& add(const Command& command);

  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  // From 0.
  Command operator[](std::size_t i) const;

 private:
  // A command without texts.
  struct Setpoint {
    CommandKind kind = CommandKind::heartbeat;
    std::uint8_t channel = 0;
    Direction direction = Direction::reverse;
    bool on = false;
    std::int32_t value = 0;
    std::int32_t speed = 0;
  };
  std::array<Setpoint, max_group> setpoints_;
  std::uint8_t size_ = 0;
};

}  // namespace r4
