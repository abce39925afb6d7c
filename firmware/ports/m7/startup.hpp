// SPDX-License-Identifier: GPL-3.0-or-later
// From reset to main(); the linker script's symbols. The image defines main() and its handlers.
#pragma once

#include <cstdint>

extern "C" {
// The loop's stack, at the bottom of the RAM, and the handlers' stack.
extern std::uint32_t r4_stack[];
extern std::uint32_t r4_stack_end[];
extern std::uint32_t r4_handler_stack[];
extern std::uint32_t r4_handler_stack_end[];

// Set before the board starts: a random number, and 1 to switch on the pins report.
extern std::uint32_t r4_chance;
extern std::uint32_t r4_wants_pins;

int main();
void r4_uart0_receive();
void r4_uart0_transmit();
void r4_wake();  // each millisecond, from timer 1
void r4_ethernet();
}

namespace r4 {
namespace m7 {

constexpr std::uint32_t untouched = 0xC0FFEE55;  // in unused stack

// The highest use of the stack from `begin` to `end`, in bytes.
inline std::uint32_t used_at_most(const std::uint32_t* begin, const std::uint32_t* end) {
  const std::uint32_t* at = begin;
  while (at != end && *at == untouched) ++at;
  return static_cast<std::uint32_t>((end - at) * 4);
}

// True if the word between the stacks is whole. The handlers' stack grows towards this word.
inline bool canary_alive() { return *r4_handler_stack == untouched; }

}  // namespace m7
}  // namespace r4
