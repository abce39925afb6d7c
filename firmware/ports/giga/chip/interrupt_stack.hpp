// SPDX-License-Identifier: GPL-3.0-or-later
// The stacks of what interrupts.
//
// The core gives the handlers of all interrupts one stack of 1 KB, at the end of the RAM, and its own
// handler for USB takes more than half of it. So our handlers work on a stack of their own:
//
//     stack    bytes   who is on it
//     core's    1024   the core's handlers; of ours only the way to on_own_stack(), and edges of pins
//     own       4096   the work of our handlers; above one that gives way, the core's, too
//     last       768   a boot that ends: of the other two nothing may be whole
//
// The lowest words of the first two hold a mark. The guard's interrupt looks for it each millisecond;
// where it is gone, the stack is full, and the boot ends with everything off (fault.hpp).
// tests/giga/stack_bounds.py asserts that what the compiler says of our handlers fits.
#pragma once

#include <cstdint>

namespace r4 {
namespace giga {

// Runs `work` on our stack; from an interrupt handler only. If one that runs there is interrupted,
// the other goes on above it.
void on_own_stack(void (*work)());

// Goes on with `work` on the last stack; from anywhere. What was on the one before is gone.
[[noreturn]] void on_last_stack(void (*work)());

// Marks the two stacks, as far as they are unused. Before our first interrupt.
void mark_interrupt_stacks();
// Has neither been filled to its last words?
bool interrupt_stacks_whole();

struct StackUse {
  std::uint32_t most;  // bytes that it has held since it was marked
  std::uint32_t size;
};
StackUse use_of_core_stack();
StackUse use_of_own_stack();

}  // namespace giga
}  // namespace r4
