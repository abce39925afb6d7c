// SPDX-License-Identifier: GPL-3.0-or-later
#include "user_uart_controller.hpp"

namespace r4 {
namespace giga {

namespace {

constexpr std::uint32_t cr1_on = 1U << 0;
constexpr std::uint32_t cr1_receives = 1U << 2;
constexpr std::uint32_t cr1_sends = 1U << 3;
constexpr std::uint32_t cr1_odd = 1U << 9;
constexpr std::uint32_t cr1_parity = 1U << 10;
constexpr std::uint32_t cr1_nine_bits = 1U << 12;  // the ninth is parity
constexpr std::uint32_t cr1_fifo = 1U << 29;
constexpr std::uint32_t cr2_two_stop_bits = 2U << 12;
constexpr std::uint32_t damaged = 7;  // parity, framing or noise error of the byte in RDR
constexpr std::uint32_t overrun = 1U << 3;
constexpr std::uint32_t has_byte = 1U << 5;
constexpr std::uint32_t has_room = 1U << 7;
constexpr std::uint32_t rqr_empty_fifo = 1U << 4;  // TXFRQ: the transmit FIFO
constexpr int bytes_in = 2;                        // per tick

}  // namespace

UartTiming user_uart_timing(std::uint32_t kernel_hz, std::uint32_t baud) {
  constexpr std::uint32_t longest = 0xFFFF;
  // PRESC 0, 1 and 2 divide by 1, 2 and 4.
  UartTiming timing{0, 0};
  for (;; ++timing.prescaler) {
    const std::uint32_t clock = kernel_hz >> timing.prescaler;
    timing.divider = (clock + baud / 2) / baud;
    if (timing.divider <= longest || timing.prescaler == 2) return timing;
  }
}

void UserUartController::start(std::uint32_t kernel_hz) {
  kernel_hz_ = kernel_hz;
  begin();
}

void UserUartController::set_up(const UartMode& mode) {
  mode_ = mode;
  begin();
}

void UserUartController::begin() {
  runs_ = false;
  if (kernel_hz_ == 0) return;
  registers_.CR1 = 0;
  received_.cut(0);
  waiting_.cut(0);
  if (!mode_.on()) {
    make_input(tx_, LinePull::none);
    make_input(rx_, LinePull::none);
    return;
  }
  const UartTiming timing = user_uart_timing(kernel_hz_, mode_.baud);
  registers_.PRESC = timing.prescaler;
  registers_.BRR = timing.divider;
  registers_.CR2 = mode_.stop_bits == 2 ? cr2_two_stop_bits : 0U;
  std::uint32_t control = cr1_fifo | cr1_receives | cr1_sends;
  if (mode_.parity != 'N') control |= cr1_parity | cr1_nine_bits;
  if (mode_.parity == 'O') control |= cr1_odd;
  registers_.CR1 = control;
  registers_.CR1 = control | cr1_on;
  make_alternate(tx_, function_, LinePull::up);
  make_alternate(rx_, function_, LinePull::up);
  runs_ = true;
}

void UserUartController::move(bool sends) {
  std::uint32_t status = registers_.ISR;
  for (int i = 0; i < bytes_in && (status & has_byte) != 0; ++i) {
    // Clear the flags before the read. After the read the flags belong to the next byte.
    if ((status & damaged) != 0) registers_.ICR = damaged;
    const char byte = static_cast<char>(registers_.RDR & 0xFFU);
    if ((status & damaged) != 0 || !received_.put(byte)) lost_ = lost_ + 1;
    status = (status & overrun) | registers_.ISR;
  }
  if ((status & overrun) != 0) {
    lost_ = lost_ + 1;  // at least one byte is lost
    registers_.ICR = overrun;
  }
  char next = 0;
  if (sends && (status & has_room) != 0 && waiting_.take(next)) {
    registers_.TDR = static_cast<unsigned char>(next);
  }
}

std::size_t UserUartController::receive(std::uint8_t* out, std::size_t size) {
  return received_.take(reinterpret_cast<char*>(out), static_cast<std::uint32_t>(size));
}

std::uint32_t UserUartController::take_lost() {
  const std::uint32_t lost = lost_;
  const std::uint32_t fresh = lost - told_lost_;
  told_lost_ = lost;
  return fresh;
}

bool UserUartController::send(const std::uint8_t* bytes, std::size_t size) {
  return waiting_.put(reinterpret_cast<const char*>(bytes), static_cast<std::uint32_t>(size));
}

void UserUartController::drop() {
  const InterruptLock lock;
  waiting_.cut(0);
  if (runs_) registers_.RQR = rqr_empty_fifo;
}

}  // namespace giga
}  // namespace r4
