// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "r4link/error.hpp"

namespace r4::tool {

enum class Severity : std::uint8_t {
  ok,
  note,
  warning,  // the link works, but not as well as it could
  error,
};
const char* to_text(Severity severity);

// automatic: --fix may run the command, because it removes nothing and needs no choice.
enum class Mending : std::uint8_t { by_hand, automatic };

struct Finding {
  Severity severity = Severity::ok;
  std::string check;  // "serial.permission"
  std::string thing;  // "/dev/ttyACM0"
  std::string reason;
  std::string fix;  // a shell command; empty if there is none
  Mending mending = Mending::by_hand;
  ErrorKind kind = ErrorKind::data;  // for an error: the exit code that r4 would return

  bool is_trouble() const { return severity >= Severity::warning; }
};

using Findings = std::vector<Finding>;

// The exit code: 0 without trouble, the kind of the first error, or 1 if there are only warnings.
int exit_code(const Findings& findings);

}  // namespace r4::tool
