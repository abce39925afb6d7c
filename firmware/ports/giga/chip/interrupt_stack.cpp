// SPDX-License-Identifier: GPL-3.0-or-later
#include "interrupt_stack.hpp"

#include <iterator>

#include "chip.hpp"
#include "interrupt_lock.hpp"

extern "C" {
extern std::uint32_t __StackLimit[];  // NOLINT: the linker script's name

// NOLINTBEGIN(cppcoreguidelines-avoid-non-const-global-variables)
alignas(8) std::uint32_t r4_giga_own_stack[1024];
alignas(8) std::uint32_t r4_giga_last_stack[192];
// NOLINTEND(cppcoreguidelines-avoid-non-const-global-variables)

extern std::uint32_t* const r4_giga_last_stack_top;
[[gnu::used]] std::uint32_t* const r4_giga_last_stack_top = std::end(r4_giga_last_stack);
}

namespace r4 {
namespace giga {

namespace {

constexpr std::uint32_t unused = 0xC0FFEE55;
constexpr std::uint32_t mark_words = 8;
constexpr std::uint32_t own_words = sizeof r4_giga_own_stack / sizeof(std::uint32_t);
constexpr std::uint32_t core_words = MBED_CONF_TARGET_BOOT_STACK_SIZE / sizeof(std::uint32_t);

std::uint32_t* stack_pointer() {  // NOLINTNEXTLINE(performance-no-int-to-ptr): a register
  return reinterpret_cast<std::uint32_t*>(static_cast<std::uintptr_t>(__get_MSP()));
}

StackUse use_of(const volatile std::uint32_t* stack, std::uint32_t words) {
  std::uint32_t free = 0;
  while (free < words && stack[free] == unused) ++free;
  constexpr std::uint32_t size_of_word = sizeof(std::uint32_t);
  return {(words - free) * size_of_word, words * size_of_word};
}

bool marked(const volatile std::uint32_t* stack) { return use_of(stack, mark_words).most == 0; }

#ifdef __arm__
[[gnu::naked]] void run_on(void (*)(), std::uint32_t*) {
  asm volatile(
      "push {r4, lr}\n"
      "mov r4, sp\n"
      "mov sp, r1\n"
      "blx r0\n"
      "mov sp, r4\n"
      "pop {r4, pc}\n");
}
[[gnu::naked, noreturn]] void go_on_at(void (*)(), std::uint32_t*) {
  asm volatile(
      "mov sp, r1\n"
      "bx r0\n");
}
#else
void run_on(void (*work)(), std::uint32_t*) { work(); }
[[noreturn]] void go_on_at(void (*work)(), std::uint32_t*) {
  work();
  for (;;) {
  }
}
#endif

}  // namespace

void on_own_stack(void (*work)()) {
  const std::uint32_t* const here = stack_pointer();
  if (here > r4_giga_own_stack && here <= std::end(r4_giga_own_stack)) {
    work();
  } else {
    run_on(work, std::end(r4_giga_own_stack));
  }
}

void on_last_stack(void (*work)()) { go_on_at(work, r4_giga_last_stack_top); }

void mark_interrupt_stacks() {
  constexpr std::uint32_t kept_words = 16;  // below the part in use
  for (std::uint32_t& word : r4_giga_own_stack) word = unused;
  const InterruptLock lock;
  volatile std::uint32_t* const end = stack_pointer() - kept_words;
  for (volatile std::uint32_t* at = __StackLimit; at < end; ++at) *at = unused;
}

bool interrupt_stacks_whole() { return marked(__StackLimit) && marked(r4_giga_own_stack); }

StackUse use_of_core_stack() { return use_of(__StackLimit, core_words); }
StackUse use_of_own_stack() { return use_of(r4_giga_own_stack, own_words); }

}  // namespace giga
}  // namespace r4
