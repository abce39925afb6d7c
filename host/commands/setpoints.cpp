// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/setpoints.hpp"

#include <fmt/format.h>

#include "../../protocol/messages/command_group.hpp"
#include "command_help.hpp"
#include "r4link/commands/command_text.hpp"

namespace r4 {

namespace {

Problem bad_group_member(const Command& command, std::size_t others) {
  Problem problem{ErrorKind::usage, shown(command), "", ""};
  if (!joins_groups(command.kind)) {
    problem.reason =
        std::string(drives_output(command.kind) ? "is a transfer of its own" : "drives no output") +
        ", so it cannot be part of a group";
    problem.fix = "send the command alone; a group may contain O D S R P B Z and X:DAC";
  } else if (others == max_group) {
    problem.reason = fmt::format("is one command too many: a group has at most {}", max_group);
    problem.fix = "send a second group";
  } else {
    problem.reason = "is the second command for its channel in this group";
    problem.fix = "leave out one of the two commands";
  }
  return problem;
}

}  // namespace

Duty checked_duty(double duty) {
  if (Duty(duty).is_in_range()) return Duty(duty);
  throw Error(ErrorKind::usage, fmt::format("duty {}", duty), "is out of range",
              "give -1 (full reverse) to 1 (full forward)");
}

Setpoints& Setpoints::add(const Command& command) {
  require_valid(command);
  GroupRules rules;
  for (std::size_t i = 0; i < size_; ++i) rules.add((*this)[i]);
  if (rules.add(command) != Refusal::none) throw Error(bad_group_member(command, size_));
  Setpoint& setpoint = setpoints_[size_++];
  setpoint.kind = command.kind;
  setpoint.channel = command.channel;
  setpoint.direction = command.direction;
  setpoint.on = command.on;
  setpoint.value = command.value;
  setpoint.speed = command.speed;
  return *this;
}

Command Setpoints::operator[](std::size_t i) const {
  const Setpoint& setpoint = setpoints_[i];
  Command command;
  command.kind = setpoint.kind;
  command.channel = setpoint.channel;
  command.direction = setpoint.direction;
  command.on = setpoint.on;
  command.value = setpoint.value;
  command.speed = setpoint.speed;
  return command;
}

}  // namespace r4
