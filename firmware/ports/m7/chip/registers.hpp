// SPDX-License-Identifier: GPL-3.0-or-later
// The registers of QEMU's `mps2-an500` (Cortex-M7) that this port uses. Sources: ARM DAI 0500
// (AN500), ARM DDI 0479 (CMSDK), the LAN9118 data sheet.
#pragma once

#include <cstdint>

namespace r4 {
namespace m7 {

inline volatile std::uint32_t& at(std::uint32_t address) {
  return *reinterpret_cast<volatile std::uint32_t*>(address);  // NOLINT(performance-no-int-to-ptr)
}

constexpr std::uint32_t clock_hz = 25000000;

constexpr std::uint32_t timer0_base = 0x40000000;  // CMSDK timer: time
constexpr std::uint32_t timer1_base = 0x40001000;  // CMSDK timer: wakes the loop
constexpr std::uint32_t uart0_base = 0x40004000;   // CMSDK UART: the link
constexpr std::uint32_t uart1_base = 0x40005000;   // CMSDK UART: the board's log
constexpr std::uint32_t uart2_base = 0x40006000;   // CMSDK UART: pins report
constexpr std::uint32_t watchdog_base = 0x40008000;
constexpr std::uint32_t ethernet_base = 0xA0000000;  // LAN9118

enum class Irq : std::uint8_t { uart0_rx = 0, uart0_tx = 1, timer1 = 9, ethernet = 13 };
constexpr int irq_count = 16;

// Cortex-M7 (ARM DDI 0403).
constexpr std::uint32_t nvic_enable = 0xE000E100;
constexpr std::uint32_t nvic_disable = 0xE000E180;
constexpr std::uint32_t nvic_pend = 0xE000E200;
constexpr std::uint32_t nvic_forget = 0xE000E280;
constexpr std::uint32_t nvic_priority = 0xE000E400;  // a byte for each interrupt
constexpr std::uint32_t scb_aircr = 0xE000ED0C;
constexpr std::uint32_t scb_shcsr = 0xE000ED24;
constexpr std::uint32_t scb_cfsr = 0xE000ED28;
constexpr std::uint32_t scb_hfsr = 0xE000ED2C;
constexpr std::uint32_t scb_mmfar = 0xE000ED34;
constexpr std::uint32_t scb_bfar = 0xE000ED38;
constexpr std::uint32_t mpu_control = 0xE000ED94;
constexpr std::uint32_t mpu_rbar = 0xE000ED9C;
constexpr std::uint32_t mpu_rasr = 0xE000EDA0;

inline void enable(Irq irq) { at(nvic_enable) = 1U << static_cast<unsigned>(irq); }
inline void disable(Irq irq) {
  at(nvic_disable) = 1U << static_cast<unsigned>(irq);
  at(nvic_forget) = 1U << static_cast<unsigned>(irq);
}
inline void pend(Irq irq) { at(nvic_pend) = 1U << static_cast<unsigned>(irq); }
inline void give_way(Irq irq) {
  constexpr std::uint32_t lowest = 0xFF;
  const std::uint32_t shift = static_cast<unsigned>(irq) % 4 * 8;
  volatile std::uint32_t& priority = at(nvic_priority + static_cast<unsigned>(irq) / 4 * 4);
  priority = (priority & ~(0xFFU << shift)) | lowest << shift;
}

inline void interrupts_off() { asm volatile("cpsid i" ::: "memory"); }
inline void interrupts_on() { asm volatile("cpsie i" ::: "memory"); }
// Keeps interrupts off while it exists. May be nested.
class InterruptsHeld {
 public:
  InterruptsHeld() : before_(hold()) {}
  ~InterruptsHeld() { release(before_); }
  InterruptsHeld(const InterruptsHeld&) = delete;
  InterruptsHeld& operator=(const InterruptsHeld&) = delete;

  static std::uint32_t hold() {
    std::uint32_t before = 0;
    asm volatile("mrs %0, primask\n\tcpsid i" : "=r"(before) : : "memory");
    return before;
  }
  static void release(std::uint32_t before) {
    asm volatile("msr primask, %0" : : "r"(before) : "memory");
  }

 private:
  std::uint32_t before_;
};
// Returns when an interrupt is pending, also with interrupts off.
inline void wait_for_interrupt() { asm volatile("dsb\n\twfi" ::: "memory"); }

[[noreturn]] inline void reset() {
  asm volatile("dsb" ::: "memory");
  at(scb_aircr) = 0x05FA0004;
  for (;;) {
  }
}

}  // namespace m7
}  // namespace r4
