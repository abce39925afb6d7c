// SPDX-License-Identifier: GPL-3.0-or-later
#include "startup.hpp"

#include "chip/registers.hpp"
#include "fault.hpp"

extern "C" {

extern std::uint32_t r4_data_load[];
extern std::uint32_t r4_data[];
extern std::uint32_t r4_data_end[];
extern std::uint32_t r4_bss[];
extern std::uint32_t r4_bss_end[];
using Constructor = void (*)();
extern const Constructor r4_constructors[];
extern const Constructor r4_constructors_end[];

void r4_count_boot();

// First code after reset. The loop has its own stack, so its overflow spares the handlers' stack.
__attribute__((naked, noreturn, used)) void r4_reset() {
  asm volatile(
      "ldr r0, =r4_stack_end\n\t"
      "msr psp, r0\n\t"
      "movs r0, #2\n\t"
      "msr control, r0\n\t"
      "isb\n\t"
      "b r4_start\n\t"
      ".ltorg");
}

// All faults and the watchdog. Passes the exception frame on the stack in use.
__attribute__((naked, noreturn, used)) void r4_exception() {
  asm volatile(
      "tst lr, #4\n\t"
      "ite eq\n\t"
      "mrseq r0, msp\n\t"
      "mrsne r0, psp\n\t"
      "b r4_on_exception");
}

[[noreturn, gnu::used]] void r4_start() {
  // Volatile, so that the compiler emits no calls, which would use the stack below.
  volatile std::uint32_t* const top = static_cast<std::uint32_t*>(__builtin_frame_address(0)) - 32;
  for (volatile std::uint32_t* at = r4_stack; at < top; ++at) *at = r4::m7::untouched;
  for (volatile std::uint32_t* at = r4_handler_stack; at < r4_handler_stack_end; ++at) {
    *at = r4::m7::untouched;
  }
  const std::uint32_t* from = r4_data_load;
  for (volatile std::uint32_t* to = r4_data; to < r4_data_end; ++to) *to = *from++;
  for (volatile std::uint32_t* to = r4_bss; to < r4_bss_end; ++to) *to = 0;
  r4_count_boot();
  for (const Constructor* each = r4_constructors; each != r4_constructors_end; ++each) (*each)();
  main();
  r4::m7::halt();
}

// The compiler needs this function, and the C++ library's version would link the heap.
[[noreturn]] void __cxa_pure_virtual() { r4::m7::halt(); }  // NOLINT(bugprone-reserved-identifier)

// Defaults for images that do not use the interrupt.
[[gnu::weak]] void r4_uart0_receive() { r4::m7::halt(); }
[[gnu::weak]] void r4_uart0_transmit() { r4::m7::halt(); }
[[gnu::weak]] void r4_wake() { r4::m7::halt(); }
[[gnu::weak]] void r4_ethernet() { r4::m7::halt(); }

}  // extern "C"

namespace {

using Handler = void (*)();

struct Vectors {
  std::uint32_t* stack;
  Handler exceptions[15];
  Handler interrupts[r4::m7::irq_count];
};

__attribute__((section(".vectors"), used)) const Vectors vectors = {
    r4_handler_stack_end,
    {r4_reset, r4_exception, r4_exception, r4_exception, r4_exception, r4_exception, r4_exception,
     r4_exception, r4_exception, r4_exception, r4_exception, r4_exception, r4_exception,
     r4_exception, r4_exception},
    {r4_uart0_receive, r4_uart0_transmit, r4_exception, r4_exception, r4_exception, r4_exception,
     r4_exception, r4_exception, r4_exception, r4_wake, r4_exception, r4_exception, r4_exception,
     r4_ethernet, r4_exception, r4_exception},
};

}  // namespace
