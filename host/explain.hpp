// SPDX-License-Identifier: GPL-3.0-or-later
// What became of a command, or of the link, in words: the thing, the reason and the fix.
#pragma once

#include <string>
#include <string_view>

#include "../transports/error.hpp"
#include "session/session.hpp"

namespace r4 {

// What to do where a stop is not confirmed.
inline constexpr std::string_view stop_last_resort = "CUT THE POWER if it must stop now";

// "up", "down", "warning".
constexpr const char* to_text(CarrierEvent::Kind kind) {
  switch (kind) {
    case CarrierEvent::Kind::up:
      return "up";
    case CarrierEvent::Kind::down:
      return "down";
    case CarrierEvent::Kind::warning:
      break;
  }
  return "warning";
}

// How the link is and, where something is wrong with it, what to do: "another host controls the
// board" and "stop it, or …". `thing` is the board's name. Of kind refused.
Problem explain(std::string_view name, const LinkStatus& link);

// What is wrong with keys, and what to do; of kind refused. Not for KeyTrouble::none.
Problem explain(KeyTrouble trouble);

// Why the session is not armed, and what to do; of kind refused. Not for DisarmCause::none.
Problem explain(std::string_view command, DisarmCause cause);

// Why `command` ("O:358,1,1") was not confirmed. `link` is the link at that time. Of kind refused.
Problem explain(std::string_view command, const CommandResult& result, const LinkStatus& link);

}  // namespace r4
