// SPDX-License-Identifier: GPL-3.0-or-later
// The stacks of interrupt handlers. The core gives all handlers one stack of 1 KB at the end of the
// RAM. Its USB handler takes more than half of this stack. So our handlers have their own stack:
//     stack    bytes   used by
//     core's    1024   the core's handlers; edges of pins; our entries to on_own_stack()
//     own       4096   our handlers, and core handlers that interrupt our handlers
//     last       768   the end of a boot, when the other stacks may be damaged
//
// The lowest words of the first two stacks hold a mark. The guard's interrupt checks the marks each
// millisecond. If a mark is overwritten, the boot ends with all outputs off (fault.hpp).
// tests/giga/stack_bounds.py checks that our handlers fit by the compiler's figures.
#pragma once

#include <cstdint>

namespace r4 {
namespace giga {

// Runs `work` on our stack. Call from an interrupt handler only. Nested handlers share the stack.
void on_own_stack(void (*work)());

// Continues with `work` on the last stack and abandons the old stack. Call from anywhere.
[[noreturn]] void on_last_stack(void (*work)());

// Marks the unused part of both stacks. Call before our first interrupt.
void mark_interrupt_stacks();
bool interrupt_stacks_whole();

struct StackUse {
  std::uint32_t most;  // highest use since the marking, in bytes
  std::uint32_t size;
};
StackUse use_of_core_stack();
StackUse use_of_own_stack();

}  // namespace giga
}  // namespace r4
