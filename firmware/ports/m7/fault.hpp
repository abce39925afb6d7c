// SPDX-License-Identifier: GPL-3.0-or-later
// After a fault the board switches every output off, stores a note and resets.
//     bus, memory or usage fault; stack overflow    -> Kind::fault
//     the loop has not fed the watchdog (NMI)       -> Kind::watchdog
//     halt() after a broken invariant               -> Kind::fault
//
// After the next boot the board reports the note and keeps its outputs off until E:CLEAR.
#pragma once

#include <cstdint>

#include "../../hal.hpp"

namespace r4 {
namespace m7 {

struct FaultNote {
  enum class Kind : std::uint32_t { none, fault, watchdog };
  Kind kind = Kind::none;
  std::uint32_t exception = 0;  // number in the Cortex-M7; 0: halt()
  std::uint32_t pc = 0;         // 0: unknown
  std::uint32_t cfsr = 0;       // cause, from CFSR
  std::uint32_t address = 0;    // invalid address of a bus or memory fault
};

// Call before any output is switched on. A fault then switches off the outputs of `hal`. Also
// makes writes to code and accesses below the loop's stack faults.
void guard(firmware::Hal& hal);

// Returns and deletes the note of the last boot.
FaultNote take_note();
std::uint32_t boots();  // since power-up

[[noreturn]] void halt();  // switches all outputs off and resets

void start_watchdog(std::uint32_t ms);
void feed_watchdog();

}  // namespace m7
}  // namespace r4
