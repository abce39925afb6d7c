// SPDX-License-Identifier: GPL-3.0-or-later
#include "lan9118.hpp"

#include "../chip/registers.hpp"

namespace r4 {
namespace m7 {

namespace {

constexpr std::uint32_t receive_data = ethernet_base + 0x00;
constexpr std::uint32_t transmit_data = ethernet_base + 0x20;
constexpr std::uint32_t receive_status = ethernet_base + 0x40;
constexpr std::uint32_t transmit_status = ethernet_base + 0x48;
constexpr std::uint32_t identity = ethernet_base + 0x50;
constexpr std::uint32_t interrupt_config = ethernet_base + 0x54;
constexpr std::uint32_t interrupt_status = ethernet_base + 0x58;
constexpr std::uint32_t interrupt_enable = ethernet_base + 0x5C;
constexpr std::uint32_t byte_test = ethernet_base + 0x64;
constexpr std::uint32_t fifo_levels = ethernet_base + 0x68;
constexpr std::uint32_t transmit_config = ethernet_base + 0x70;
constexpr std::uint32_t receive_fifo = ethernet_base + 0x7C;
constexpr std::uint32_t transmit_fifo = ethernet_base + 0x80;
constexpr std::uint32_t mac_command = ethernet_base + 0xA4;
constexpr std::uint32_t mac_data = ethernet_base + 0xA8;

constexpr std::uint32_t frames_waiting = 1U << 3;  // RSFL
constexpr std::uint32_t active_high = 0x11;        // push-pull, high
constexpr std::uint32_t interrupts_enabled = 0x100;
constexpr std::uint32_t transmitter_on = 1U << 1;
constexpr std::uint32_t receive_error = 1U << 15;

// Reached through mac_command.
constexpr std::uint32_t mac_control = 1;
constexpr std::uint32_t mac_high = 2;
constexpr std::uint32_t mac_low = 3;
constexpr std::uint32_t mac_on = 0xC;
constexpr std::uint32_t busy = 1U << 31;
constexpr std::uint32_t reading = 1U << 30;

bool mac_ready() {
  constexpr int patience = 1000;
  for (int i = 0; i < patience; ++i) {
    if ((at(mac_command) & busy) == 0) return true;
  }
  return false;
}

std::uint32_t read_mac(std::uint32_t which) {
  at(mac_command) = busy | reading | which;
  return mac_ready() ? at(mac_data) : 0;
}

bool write_mac(std::uint32_t which, std::uint32_t value) {
  at(mac_data) = value;
  at(mac_command) = busy | which;
  return mac_ready();
}

}  // namespace

bool Lan9118::start() {
  if (at(byte_test) != 0x87654321 || at(identity) >> 16 != 0x0118) return false;
  at(transmit_config) = transmitter_on;
  at(fifo_levels) = 0;  // an interrupt for each frame
  at(interrupt_config) = interrupts_enabled | active_high;
  at(interrupt_status) = ~0U;
  at(interrupt_enable) = frames_waiting;
  on_ = write_mac(mac_control, mac_on);
  return on_;
}

Mac Lan9118::mac() {
  Mac mac;
  const std::uint32_t low = read_mac(mac_low);
  const std::uint32_t high = read_mac(mac_high);
  for (unsigned i = 0; i < 4; ++i) mac.bytes[i] = static_cast<std::uint8_t>(low >> 8 * i);
  for (unsigned i = 0; i < 2; ++i) mac.bytes[4 + i] = static_cast<std::uint8_t>(high >> 8 * i);
  return mac;
}

void Lan9118::on_interrupt() { at(interrupt_status) = ~0U; }

bool Lan9118::has_received() const { return on_ && (at(receive_fifo) >> 16 & 0xFF) != 0; }

std::size_t Lan9118::receive(std::uint32_t* frame) {
  if (!has_received()) return 0;
  constexpr std::size_t check_sequence = 4;
  const std::uint32_t status = at(receive_status);
  const std::size_t size = status >> 16 & 0x3FFF;
  for (std::size_t word = 0; word * 4 < size; ++word) {
    const std::uint32_t value = at(receive_data);
    if (word * 4 < max_frame) frame[word] = value;
  }
  const bool good = (status & receive_error) == 0 && size > check_sequence && size <= max_frame;
  return good ? size - check_sequence : 0;
}

bool Lan9118::send(const std::uint32_t* frame, std::size_t size) {
  if (!on_) return false;
  // Discards the status of sent frames to make room.
  for (std::uint32_t left = at(transmit_fifo) >> 16 & 0xFF; left != 0; --left) {
    const std::uint32_t status = at(transmit_status);
    static_cast<void>(status);
  }
  constexpr std::size_t commands = 8;
  constexpr std::uint32_t first_and_last = 0x3000;
  if ((at(transmit_fifo) & 0xFFFF) < size + 3 + commands) return false;
  at(transmit_data) = first_and_last | static_cast<std::uint32_t>(size);
  at(transmit_data) = static_cast<std::uint32_t>(size);
  for (std::size_t word = 0; word * 4 < size; ++word) at(transmit_data) = frame[word];
  return true;
}

}  // namespace m7
}  // namespace r4
