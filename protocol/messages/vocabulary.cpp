// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/vocabulary.hpp"

namespace r4 {

const char* to_text(SafeReason reason) {
  switch (reason) {
    case SafeReason::none:
      return "none";
    case SafeReason::link:
      return "link";
    case SafeReason::stop:
      return "stop";
    case SafeReason::handle:
      return "handle";
    case SafeReason::proximity:
      return "proximity";
    case SafeReason::watchdog:
      return "watchdog";
    case SafeReason::fault:
      return "fault";
  }
  return "unknown";
}

}  // namespace r4
