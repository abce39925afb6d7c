// SPDX-License-Identifier: GPL-3.0-or-later
// Why a board refuses a command: the code of `N:<PNum>,<code>` (docs/protocol.md).
#pragma once

#include <cstdint>

#include "text.hpp"

namespace r4 {

enum class Refusal : std::uint8_t {
  none,
  unknown,    // no such command, field or setting
  format,     // not the command's form
  range,      // a value outside its range
  channel,    // no such channel
  stale,      // older than what was executed, or delayed too long
  duplicate,  // this very packet number was executed
  safe,       // outputs are in the safe state
  busy,       // another host controls the board
  auth,       // not authenticated
};

// "UNKNOWN", "FORMAT" …; "NONE" for none.
Text name_of(Refusal refusal);
// The refusal of that name; Refusal::none if there is none.
Refusal refusal_from(Text name);

}  // namespace r4
