// SPDX-License-Identifier: GPL-3.0-or-later
// Commands that only switch outputs off, and so are wanted however late they are.
#pragma once

#include <cstddef>

#include "r4link/command.hpp"
#include "r4link/setpoints.hpp"

namespace r4 {

inline bool switches_off(const Command& command) {
#define R4_OUTPUT(output, ...) \
  if (command.kind == CommandKind::output) return command.value == 0;
#include "r4link/tables/board.def"
  return (command.kind == CommandKind::relay && !command.on) || command.kind == CommandKind::stop;
}

// True if each command of the group switches its output off.
inline bool switches_off(const Setpoints& group) {
  for (std::size_t i = 0; i < group.size(); ++i) {
    if (!switches_off(group[i])) return false;
  }
  return true;
}

}  // namespace r4
