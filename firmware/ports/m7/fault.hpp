// SPDX-License-Identifier: GPL-3.0-or-later
// What the board does when it finds itself broken: every output off, at once; note what it was; reset.
//
//     bus fault, memory fault (a stack overflow too), usage fault ... -> Kind::fault
//     the loop has not fed the watchdog (NMI)                         -> Kind::watchdog
//     a broken invariant: halt()                                      -> Kind::fault
//
// The next boot finds the note with take_note() and reports it; E:CLEAR releases the outputs.
#pragma once

#include <cstdint>

#include "../../hal.hpp"

namespace r4 {
namespace m7 {

struct FaultNote {
  enum class Kind : std::uint32_t { none, fault, watchdog };
  Kind kind = Kind::none;
  std::uint32_t exception = 0;  // the Cortex-M7's number of it; 0: none, halt()
  std::uint32_t pc = 0;         // where it was; 0: unknown
  std::uint32_t cfsr = 0;       // why, as the Cortex-M7 tells
  std::uint32_t address = 0;    // the address that did not work, for a bus or memory fault
};

// Whose outputs a fault switches off, and faults for what the memory must not be used for: writing
// code, and what is below the loop's stack. To be called before any output is switched on.
void guard(firmware::Hal& hal);

// What ended the last boot; once.
FaultNote take_note();
// Boots since the power came.
std::uint32_t boots();

// Switches everything off, and the board off and on again.
[[noreturn]] void halt();

// The watchdog: after `ms` without feed() it ends the boot.
void start_watchdog(std::uint32_t ms);
void feed_watchdog();

}  // namespace m7
}  // namespace r4
