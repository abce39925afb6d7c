// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/vocabulary.hpp"

namespace r4 {

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
