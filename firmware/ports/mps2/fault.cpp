// SPDX-License-Identifier: GPL-3.0-or-later
#include "fault.hpp"

#include "registers.hpp"
#include "startup.hpp"

namespace r4 {
namespace mps2 {

namespace {

// Over a reset it stays; when the power comes it is anything, so it counts only with both marks.
struct Kept {
  std::uint32_t mark;
  std::uint32_t boots;
  FaultNote note;
  std::uint32_t end_mark;
};
constexpr std::uint32_t mark = 0x5234464E;
__attribute__((section(".kept"))) Kept kept;  // NOLINT(cppcoreguidelines-avoid-non-const-*)
firmware::Hal* guarded = nullptr;             // NOLINT(cppcoreguidelines-avoid-non-const-*)

Kept& kept_data() {
  if (kept.mark != mark || kept.end_mark != mark) {
    kept.mark = mark;
    kept.end_mark = mark;
    kept.boots = 0;
    kept.note = FaultNote();
  }
  return kept;
}

// What the processor puts on the stack for an exception.
struct Frame {
  std::uint32_t r0, r1, r2, r3, r12, lr, pc, psr;
};

bool in_stacks(const Frame* frame) {
  return reinterpret_cast<std::uintptr_t>(frame) >= reinterpret_cast<std::uintptr_t>(r4_stack) &&
         reinterpret_cast<std::uintptr_t>(frame + 1) <=
             reinterpret_cast<std::uintptr_t>(r4_handler_stack_end);
}

// Registers of the CMSDK watchdog.
constexpr std::uint32_t watchdog_load = watchdog_base + 0x0;
constexpr std::uint32_t watchdog_control = watchdog_base + 0x8;
constexpr std::uint32_t watchdog_clear = watchdog_base + 0xC;
constexpr std::uint32_t watchdog_lock = watchdog_base + 0xC00;

[[noreturn]] void end(FaultNote note) {
  interrupts_off();
  if (guarded != nullptr) guarded->make_safe();
  kept_data().note = note;
  reset();
}

constexpr std::uint32_t nmi = 2;

}  // namespace

void guard(firmware::Hal& hal) { guarded = &hal; }

FaultNote take_note() {
  Kept& data = kept_data();
  const FaultNote note = data.note;
  data.note = FaultNote();
  return note;
}

std::uint32_t boots() { return kept_data().boots; }

void halt() {
  FaultNote note;
  note.kind = FaultNote::Kind::fault;
  note.pc = reinterpret_cast<std::uint32_t>(__builtin_return_address(0));
  end(note);
}

void start_watchdog(std::uint32_t ms) {
  constexpr std::uint32_t interrupt_and_reset = 3;
  at(watchdog_lock) = 0x1ACCE551;
  at(watchdog_load) = clock_hz / 1000 * ms;
  at(watchdog_control) = interrupt_and_reset;
}

void feed_watchdog() { at(watchdog_clear) = 1; }

// From the vector table, by way of r4_exception.
extern "C" [[noreturn, gnu::used]] void r4_on_exception(const Frame* frame) {
  std::uint32_t exception = 0;
  asm volatile("mrs %0, ipsr" : "=r"(exception));
  FaultNote note;
  note.kind = exception == nmi ? FaultNote::Kind::watchdog : FaultNote::Kind::fault;
  note.exception = exception;
  if (in_stacks(frame)) note.pc = frame->pc;
  note.cfsr = at(scb_cfsr);
  note.address = at(scb_bfar);
  end(note);
}

extern "C" void r4_count_boot() { ++kept_data().boots; }

}  // namespace mps2
}  // namespace r4
