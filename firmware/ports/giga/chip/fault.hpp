// SPDX-License-Identifier: GPL-3.0-or-later
// After a fault the board switches every output off, stores a note and resets.
//     bus, memory or usage fault, hard fault          -> Kind::fault, where and why
//     the core gives up (mbed error, failed assert)   -> Kind::fault, its status
//     the core warns (mbed warning)                   -> nothing
//     a stack of the interrupts is full               -> Kind::stack
//     duties do not check in (the guard starves)      -> Kind::watchdog
//     the timer interrupt stops                       -> the watchdog's reset
//
// The note is in backup registers. The next boot reports it and keeps outputs off until E:CLEAR.
#pragma once

#include <cstdint>

#include "../../../hal.hpp"

namespace r4 {
namespace giga {

struct FaultNote {
  enum class Kind : std::uint32_t { none, fault, watchdog, stack };
  Kind kind = Kind::none;
  std::uint32_t exception = 0;  // number in the Cortex-M7; 0: error of the core
  std::uint32_t pc = 0;         // 0: unknown
  std::uint32_t status = 0;     // CFSR, or the core's error status
  bool in_store = false;        // the settings store was starting
};

void guard_against_faults();
// Call before any output is switched on. A fault then switches off the outputs of `hal`.
void guard_outputs(firmware::Hal& hal);

// Call from any thread. If the boot ends meanwhile, the boot's note has in_store.
void store_is_starting(bool starting);

// Returns and deletes the note of the last boot.
FaultNote take_fault_note();

[[noreturn]] void end_boot(const FaultNote& note);

}  // namespace giga
}  // namespace r4
