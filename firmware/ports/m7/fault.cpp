// SPDX-License-Identifier: GPL-3.0-or-later
#include "fault.hpp"

#include "chip/registers.hpp"
#include "startup.hpp"

namespace r4 {
namespace m7 {

namespace {

// Survives a reset: no code may initialize it. Random after power-up; valid only with both marks.
struct Kept {
  std::uint32_t mark;
  std::uint32_t boots;
  std::uint32_t kind;  // this and the next four as in FaultNote
  std::uint32_t exception;
  std::uint32_t pc;
  std::uint32_t cfsr;
  std::uint32_t address;
  std::uint32_t end_mark;
};
constexpr std::uint32_t mark = 0x5234464E;
__attribute__((section(".kept"))) Kept kept;  // NOLINT(cppcoreguidelines-avoid-non-const-*)
firmware::Hal* guarded = nullptr;             // NOLINT(cppcoreguidelines-avoid-non-const-*)

void keep(const FaultNote& note) {
  kept.kind = static_cast<std::uint32_t>(note.kind);
  kept.exception = note.exception;
  kept.pc = note.pc;
  kept.cfsr = note.cfsr;
  kept.address = note.address;
}

Kept& kept_data() {
  if (kept.mark != mark || kept.end_mark != mark) {
    kept.mark = mark;
    kept.end_mark = mark;
    kept.boots = 0;
    keep(FaultNote());
  }
  return kept;
}

struct Frame {  // on the stack after an exception
  std::uint32_t r0, r1, r2, r3, r12, lr, pc, psr;
};

bool in_stacks(const Frame* frame) {
  return reinterpret_cast<std::uintptr_t>(frame) >= reinterpret_cast<std::uintptr_t>(r4_stack) &&
         reinterpret_cast<std::uintptr_t>(frame + 1) <=
             reinterpret_cast<std::uintptr_t>(r4_handler_stack_end);
}

constexpr std::uint32_t watchdog_load = watchdog_base + 0x0;
constexpr std::uint32_t watchdog_control = watchdog_base + 0x8;
constexpr std::uint32_t watchdog_clear = watchdog_base + 0xC;
constexpr std::uint32_t watchdog_lock = watchdog_base + 0xC00;

[[noreturn]] void end(FaultNote note) {
  interrupts_off();
  if (guarded != nullptr) guarded->make_safe();
  kept_data();
  keep(note);
  reset();
}

constexpr std::uint32_t nmi = 2;
constexpr std::uint32_t memory_fault = 4;

void protect(std::uint32_t number, std::uint32_t base, std::uint32_t log_size,
             std::uint32_t attributes) {
  constexpr std::uint32_t valid = 0x10;
  constexpr std::uint32_t on = 1;
  at(mpu_rbar) = base | valid | number;
  at(mpu_rasr) = attributes | (log_size - 1) << 1 | on;
}

void protect_memory() {
  constexpr std::uint32_t no_access = 0;
  constexpr std::uint32_t read_only = 6U << 24 | 2U << 16;  // normal memory, write-through
  constexpr std::uint32_t one_mb = 20;
  constexpr std::uint32_t on_and_rest_as_ever = 5;
  protect(0, 0, one_mb, read_only);
  const std::uint32_t bottom = reinterpret_cast<std::uint32_t>(r4_stack);
  protect(1, bottom - (1U << one_mb), one_mb, no_access);
  at(mpu_control) = on_and_rest_as_ever;
  asm volatile("dsb\n\tisb" ::: "memory");
}

}  // namespace

void guard(firmware::Hal& hal) {
  // Enables separate exceptions, so that a hard fault occurs only during another fault.
  constexpr std::uint32_t memory_bus_and_usage = 7U << 16;
  at(scb_shcsr) = memory_bus_and_usage;
  protect_memory();
  guarded = &hal;
}

FaultNote take_note() {
  const Kept& data = kept_data();
  FaultNote note;
  note.kind = static_cast<FaultNote::Kind>(data.kind);
  note.exception = data.exception;
  note.pc = data.pc;
  note.cfsr = data.cfsr;
  note.address = data.address;
  keep(FaultNote());
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

extern "C" [[noreturn, gnu::used]] void r4_on_exception(const Frame* frame) {
  std::uint32_t exception = 0;
  asm volatile("mrs %0, ipsr" : "=r"(exception));
  FaultNote note;
  note.kind = exception == nmi ? FaultNote::Kind::watchdog : FaultNote::Kind::fault;
  note.exception = exception;
  if (in_stacks(frame)) note.pc = frame->pc;
  note.cfsr = at(scb_cfsr);
  note.address = exception == memory_fault ? at(scb_mmfar) : at(scb_bfar);
  end(note);
}

extern "C" void r4_count_boot() { ++kept_data().boots; }

}  // namespace m7
}  // namespace r4
