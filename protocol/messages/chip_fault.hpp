// SPDX-License-Identifier: GPL-3.0-or-later
// What is wrong with one of the board's chips: the FAULT field, chip and trouble.
#pragma once

#include <cstdint>

namespace r4 {

// The number is what the FAULT field carries.
enum class ChipTrouble : std::uint8_t {
  none = 0,
  no_acknowledge = 1,  // it does not answer
  bus_stuck = 2,       // a line of the bus is held
  was_reset = 3,       // it lost its set-up: it must have been reset under way
  wrong_register = 4,  // a register holds what was not written
  not_ready = 5,       // it did not come up in time, or cannot store its power-on values
};
// "none", "no acknowledge", "bus stuck", "was reset", "wrong register", "not ready"; "unknown" for
// other numbers.
const char* to_text(ChipTrouble trouble);

// The chip by its I2C address.
struct ChipFault {
  std::uint8_t address = 0;
  ChipTrouble trouble = ChipTrouble::none;
  bool any() const { return trouble != ChipTrouble::none; }
  friend bool operator==(ChipFault a, ChipFault b) {
    return a.address == b.address && a.trouble == b.trouble;
  }
  friend bool operator!=(ChipFault a, ChipFault b) { return !(a == b); }
};

// The chip at an address of the board (paper, Figure 3): "PCA9685 0x40 (OSMC)". "unknown chip" for
// other addresses.
const char* chip_name(std::uint8_t address);

}  // namespace r4
