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

const char* to_text(Handle handle) {
  switch (handle) {
    case Handle::released:
      return "released";
    case Handle::held:
      return "held";
    case Handle::none:
      break;
  }
  return "none";
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

const char* to_text(ChipTrouble trouble) {
  switch (trouble) {
    case ChipTrouble::none:
      return "none";
    case ChipTrouble::no_acknowledge:
      return "no acknowledge";
    case ChipTrouble::bus_stuck:
      return "bus stuck";
    case ChipTrouble::was_reset:
      return "was reset";
    case ChipTrouble::wrong_register:
      return "wrong register";
    case ChipTrouble::not_ready:
      return "not ready";
    case ChipTrouble::not_confirmed:
      return "not confirmed";
    case ChipTrouble::damaged:
      return "damaged";
    case ChipTrouble::other_bus:
      return "other bus";
  }
  return "unknown";
}

const char* chip_name(std::uint8_t address) {
  switch (address) {
    case 0:
      return "wiring";
    case 0x20:
      return "MCP23017 0x20 (relays, BLDC direction and brake)";
    case 0x40:
      return "PCA9685 0x40 (OSMC)";
    case 0x41:
      return "PCA9685 0x41 (DHB12)";
    case 0x42:
      return "PCA9685 0x42 (servos)";
    case 0x61:
      return "MCP4728 0x61 (BLDC speed)";
    default:
      return "unknown chip";
  }
}

}  // namespace r4
