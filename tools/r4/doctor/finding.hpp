// SPDX-License-Identifier: GPL-3.0-or-later
// What r4 doctor has found: about which thing, why it matters, and the one command that mends it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "r4link/error.hpp"

namespace r4::tool {

enum class Severity : std::uint8_t {
  ok,       // it was looked at, and is as it should be
  note,     // good to know; nothing need be done
  warning,  // the link works, but worse than it could
  error,    // the link cannot work so
};
// "ok", "note", "warning", "error".
const char* to_text(Severity severity);

// Whether --fix may run the command: it takes nothing away and asks for no choice.
enum class Mending : std::uint8_t { by_hand, automatic };

struct Finding {
  Severity severity = Severity::ok;
  std::string check;   // "serial.permission"
  std::string thing;   // "/dev/ttyACM0"
  std::string reason;  // what is the matter, or how it is
  std::string fix;     // a command for the shell; empty where there is none
  Mending mending = Mending::by_hand;
  ErrorKind kind = ErrorKind::data;  // of an error: what r4 would end with

  bool is_trouble() const { return severity >= Severity::warning; }
};

using Findings = std::vector<Finding>;

// The exit code: 0 without trouble, the kind of the first error, 1 where there are warnings only.
int exit_code(const Findings& findings);

}  // namespace r4::tool
