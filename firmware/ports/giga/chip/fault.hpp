// SPDX-License-Identifier: GPL-3.0-or-later
// What the board does when it finds itself broken: every output off, at once; note what it was; reset.
//
//     bus, memory or usage fault, hard fault          -> Kind::fault, where and why
//     the core gives up (mbed error, failed assert)   -> Kind::fault, its status; its warnings: nothing
//     a stack of the interrupts is full               -> Kind::stack
//     the duties stay away (the guard starves)        -> Kind::watchdog
//     the timer interrupt itself is dead              -> the watchdog's reset, seen in RCC_RSR
//
// The note outlives the reset in backup registers of the real-time clock. The next boot reports it;
// outputs stay off until E:CLEAR.
#pragma once

#include <cstdint>

#include "../../../hal.hpp"

namespace r4 {
namespace giga {

struct FaultNote {
  enum class Kind : std::uint32_t { none, fault, watchdog, stack };
  Kind kind = Kind::none;
  std::uint32_t exception = 0;  // the Cortex-M7's number of it; 0: the core's own error
  std::uint32_t pc = 0;         // where it was; 0: unknown
  std::uint32_t status = 0;     // CFSR, or the core's error status
  bool in_store = false;        // the settings store was starting
};

// Whose outputs are switched off. Before any output is switched on.
void guard_against_faults(firmware::Hal& hal);

// From any thread: a boot that ends meanwhile is noted as in_store.
void store_is_starting(bool starting);

// What ended the last boot; once.
FaultNote take_fault_note();

[[noreturn]] void end_boot(const FaultNote& note);

}  // namespace giga
}  // namespace r4
