// SPDX-License-Identifier: GPL-3.0-or-later
// ARM semihosting, for an emulator or debugger that listens. Without one, a call is a fault.
#pragma once

#include <cstdint>

namespace r4 {
namespace m7 {

inline void semihost(std::uint32_t operation, const void* argument) {
  register std::uint32_t r0 asm("r0") = operation;
  register const void* r1 asm("r1") = argument;
  asm volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
}

inline void say(const char* text) {  // ends in NUL
  constexpr std::uint32_t write0 = 0x04;
  semihost(write0, text);
}

[[noreturn]] inline void exit_emulator(std::uint32_t status) {
  constexpr std::uint32_t exit_extended = 0x20;
  constexpr std::uint32_t application_exit = 0x20026;
  const std::uint32_t arguments[] = {application_exit, status};
  semihost(exit_extended, arguments);
  for (;;) {
  }
}

}  // namespace m7
}  // namespace r4
