// SPDX-License-Identifier: GPL-3.0-or-later
// r4::Setpoints: output commands that a board executes in one pass over its chips, or not at all.
//     board.send({r4::Command::osmc(1, r4::Duty(0.1)), r4::Command::osmc(2, r4::Duty(0.1)),
//                 r4::Command::servo(3, r4::Microseconds(1500))});
//
// The commands take effect in the order of add(), without other commands in between. Closing relay
// 1 after a motor's command cancels the motor's command (docs/reference/safety.md).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>

#include "command.hpp"
#include "config.hpp"

namespace r4 {

// `duty`: from -1 (full reverse) to 1 (full forward). Throws Error{usage} for other values.
R4LINK_API Duty checked_duty(double duty);

class R4LINK_API Setpoints {
 public:
  Setpoints() = default;
  Setpoints(std::initializer_list<Command> commands) {
    for (const Command& command : commands) add(command);
  }
  // Adds an output command: O D S R P B Z, X:DAC. Throws Error{usage} for another command, a value
  // outside its range, a second command for a channel, and more than max_group commands.
  Setpoints& add(const Command& command);

  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  Command operator[](std::size_t i) const;

 private:
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
