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

const char* to_text(I2cOutcome outcome) {
  switch (outcome) {
    case I2cOutcome::done:
      return "done";
    case I2cOutcome::no_acknowledge:
      return "no acknowledge";
    case I2cOutcome::bus_stuck:
      return "bus stuck";
    case I2cOutcome::cancelled:
      return "cancelled";
  }
  return "unknown";
}

}  // namespace r4
