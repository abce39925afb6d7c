// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/registers.hpp"
#include "fake_giga.hpp"

namespace r4::fake {

namespace {

constexpr std::size_t fifo = 16;
constexpr std::uint64_t kernel_hz = 120000000;

}  // namespace

bool UartPeripheral::on() const { return (registers_->CR1.value & 1U) != 0; }

std::uint64_t UartPeripheral::byte_ns() const {
  const std::uint64_t bits =
      10 + (registers_->CR1.value >> 12 & 1U) + ((registers_->CR2.value >> 12 & 3U) == 2 ? 1 : 0);
  return bits * registers_->BRR.value * (1000000000ULL << registers_->PRESC.value) / kernel_hz;
}

void UartPeripheral::connect(USART_TypeDef& registers) {
  registers_ = &registers;
  to_say_.clear();
  received_.clear();
  to_send_.clear();
  overrun_ = false;
  registers.CR1.on_write = [this](std::uint32_t value) {
    registers_->CR1.value = value;
    if ((value & 1U) != 0) {
      in_ns_ = out_ns_ = giga().now_ns();
      return;
    }
    received_.clear();
    to_send_.clear();
    overrun_ = false;
  };
  registers.ISR.on_read = [this] {
    pass();
    return (overrun_ ? 1U << 3 : 0U) | (received_.empty() ? 0U : 1U << 5) |
           (!received_.empty() && received_.front().damaged ? 1U << 1 : 0U) |
           (to_send_.size() < fifo ? 1U << 7 : 0U);
  };
  registers.ICR.on_write = [this](std::uint32_t value) {
    if ((value & 1U << 3) != 0) overrun_ = false;
    // Clears the damage of the byte that is read next.
    if ((value & 7U) != 0 && !received_.empty()) received_.front().damaged = false;
  };
  registers.RQR.on_write = [this](std::uint32_t value) {
    pass();
    // The first byte is on the wire already.
    if ((value & 1U << 4) != 0 && to_send_.size() > 1) to_send_.resize(1);
  };
  registers.RDR.on_read = [this] {
    if (received_.empty()) return 0U;
    const auto byte = static_cast<unsigned char>(received_.front().value);
    received_.pop_front();
    return static_cast<std::uint32_t>(byte) | 1U << 8;  // a parity bit is possible here
  };
  registers.TDR.on_write = [this](std::uint32_t value) {
    pass();
    if (to_send_.empty()) out_ns_ = giga().now_ns();
    if (to_send_.size() < fifo) to_send_.push_back(static_cast<char>(value));
  };
}

void UartPeripheral::say(const std::string& bytes) {
  if (to_say_.empty()) in_ns_ = giga().now_ns();
  to_say_.insert(to_say_.end(), bytes.begin(), bytes.end());
}

// Moves the bytes received and sent since the last call.
void UartPeripheral::pass() {
  if (!on() || registers_->BRR.value == 0) return;
  const std::uint64_t now_ns = giga().now_ns();
  for (; (noise || !to_say_.empty()) && in_ns_ + byte_ns() <= now_ns; in_ns_ += byte_ns()) {
    chance_ = chance_ * 1664525U + 1013904223U;
    const Byte byte = to_say_.empty()
                          ? Byte{static_cast<char>(chance_ >> 24), (chance_ >> 22 & 3U) == 0}
                          : Byte{to_say_.front(), false};
    if (!to_say_.empty()) to_say_.pop_front();
    said += byte.damaged ? 0 : 1;
    damaged += byte.damaged ? 1 : 0;
    if (received_.size() == fifo) {
      overrun_ = true;
    } else {
      received_.push_back(byte);
    }
  }
  if (!noise && to_say_.empty()) in_ns_ = now_ns;
  for (; !to_send_.empty() && out_ns_ + byte_ns() <= now_ns; out_ns_ += byte_ns()) {
    sent += to_send_.front();
    to_send_.pop_front();
  }
}

}  // namespace r4::fake
