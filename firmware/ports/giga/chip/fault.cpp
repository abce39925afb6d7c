// SPDX-License-Identifier: GPL-3.0-or-later
#include "fault.hpp"

#include <atomic>

#include "chip.hpp"
#include "interrupt_stack.hpp"

namespace r4 {
namespace giga {

namespace {

// NOLINTBEGIN(cppcoreguidelines-avoid-non-const-global-variables)
firmware::Hal* guarded = nullptr;
FaultNote last_note;
std::atomic<bool> store_starting{false};
// NOLINTEND(cppcoreguidelines-avoid-non-const-global-variables)

constexpr std::uint32_t mark = 0x52344700;  // the lowest byte holds the kind
constexpr std::uint32_t in_store_mark = 0x80;

// RM0399: backup domain writable (PWR_CR1), clock of the RTC registers (RCC_APB4ENR), cause of the
// reset (RCC_RSR). The Giga's boot loader clears RCC_RSR and leaves the cause in backup register 8.
constexpr std::uint32_t pwr_backup_writable = 1U << 8;
constexpr std::uint32_t rcc_rtc_on = 1U << 16;
constexpr std::uint32_t rsr_forget = 1U << 16;
constexpr std::uint32_t rsr_watchdog = 1U << 26;
constexpr std::uint32_t boot_loader_watchdog = 4;

void open_backup_registers() {
  PWR->CR1 |= pwr_backup_writable;
  RCC->APB4ENR |= rcc_rtc_on;
  static_cast<void>(static_cast<std::uint32_t>(RCC->APB4ENR));
}

// The first backup registers belong to the core and its boot loader.
void keep(const FaultNote& note) {
  open_backup_registers();
  RTC->BKP21R = note.exception;
  RTC->BKP22R = note.pc;
  RTC->BKP23R = note.status;
  RTC->BKP20R = mark | static_cast<std::uint32_t>(note.kind) | (note.in_store ? in_store_mark : 0);
}

[[noreturn]] void reset() {
  constexpr std::uint32_t key = 0x5FAU << 16;
  constexpr std::uint32_t request = 1U << 2;
  __DSB();
  SCB->AIRCR = key | (SCB->AIRCR & 0x700U) | request;
  __DSB();
  for (;;) {
  }
}

void switch_off_and_reset() {
  if (guarded != nullptr) guarded->make_safe();
  keep(last_note);
  reset();
}

constexpr int frame_pc = 6;  // in the exception frame r0-r3, r12, lr, pc, psr

bool is_stack(const std::uint32_t* frame) {
  const auto at = reinterpret_cast<std::uintptr_t>(frame);
  const bool in_dtcm = at >= 0x20000000U && at < 0x20020000U - 32;
  const bool in_ram = at >= 0x24000000U && at < 0x24080000U - 32;
  return in_dtcm || in_ram;
}

// Called for warnings too. mbed_die() would print first and may wait.
void on_core_error(const mbed_error_ctx* context) {
  if (!mbed_get_error_in_progress()) return;
  FaultNote note;
  note.kind = FaultNote::Kind::fault;
  note.pc = context->error_address;
  note.status = static_cast<std::uint32_t>(context->error_status);
  end_boot(note);
}

}  // namespace

extern "C" {

[[noreturn, gnu::used]] void r4_giga_on_fault(const std::uint32_t* frame) {
  FaultNote note;
  note.kind = FaultNote::Kind::fault;
  note.exception = __get_IPSR();
  note.status = SCB->CFSR;
  if (is_stack(frame)) note.pc = frame[frame_pc];
  end_boot(note);
}

#ifdef __arm__
// Passes the stack in use, and runs on the last stack, because the stack in use may be full.
[[gnu::naked]] void r4_giga_fault_entry() {
  asm volatile(
      "tst lr, #4\n"
      "ite eq\n"
      "mrseq r0, msp\n"
      "mrsne r0, psp\n"
      "movw r1, #:lower16:r4_giga_last_stack_top\n"
      "movt r1, #:upper16:r4_giga_last_stack_top\n"
      "ldr r1, [r1]\n"
      "mov sp, r1\n"
      "b r4_giga_on_fault\n");
}
#else
void r4_giga_fault_entry() { r4_giga_on_fault(nullptr); }
#endif

// Replaces the core's function, which blinks for ever with the motors on.
void mbed_die() {
  FaultNote note;
  note.kind = FaultNote::Kind::fault;
  end_boot(note);
}
}

void guard_outputs(firmware::Hal& hal) { guarded = &hal; }

void guard_against_faults() {
  guarded = nullptr;
  store_is_starting(false);
  const auto entry = reinterpret_cast<std::uintptr_t>(&r4_giga_fault_entry);
  for (const IRQn_Type fault :
       {HardFault_IRQn, MemoryManagement_IRQn, BusFault_IRQn, UsageFault_IRQn}) {
    NVIC_SetVector(fault, entry);
  }
  mbed_set_error_hook(&on_core_error);
}

void store_is_starting(bool starting) { store_starting.store(starting, std::memory_order_relaxed); }

FaultNote take_fault_note() {
  open_backup_registers();
  FaultNote note;
  const std::uint32_t kept = RTC->BKP20R ^ mark;
  const std::uint32_t kind = kept & ~in_store_mark;
  const bool by_watchdog = (RCC->RSR & rsr_watchdog) != 0 || RTC->BKP8R == boot_loader_watchdog;
  RCC->RSR |= rsr_forget;
  RTC->BKP8R = 0;
  if (kind >= static_cast<std::uint32_t>(FaultNote::Kind::fault) &&
      kind <= static_cast<std::uint32_t>(FaultNote::Kind::stack)) {
    note.kind = static_cast<FaultNote::Kind>(kind);
    note.exception = RTC->BKP21R;
    note.pc = RTC->BKP22R;
    note.status = RTC->BKP23R;
    note.in_store = (kept & in_store_mark) != 0;
  } else if (by_watchdog) {
    note.kind = FaultNote::Kind::watchdog;
  }
  keep(FaultNote());
  return note;
}

void end_boot(const FaultNote& note) {
  __disable_irq();
  last_note = note;
  last_note.in_store = store_starting.load(std::memory_order_relaxed);
  on_last_stack(&switch_off_and_reset);
}

}  // namespace giga
}  // namespace r4
