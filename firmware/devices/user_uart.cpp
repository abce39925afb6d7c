// SPDX-License-Identifier: GPL-3.0-or-later
#include "user_uart.hpp"

namespace r4 {
namespace firmware {

void UserUart::set_up(const UartMode& mode) {
  if (mode == mode_) return;
  mode_ = mode;
  port_.set_up(mode);
}

void UserUart::forget() { first_ = new_ = told_ = kept_; }

void UserUart::poll() {
  if (!on()) return;
  std::uint8_t taken[bytes_a_turn];
  const std::size_t size = port_.receive(taken, sizeof taken);
  for (std::size_t i = 0; i < size; ++i) {
    if (kept_ - told_ == backlog) {
      lost_ += static_cast<std::uint32_t>(size - i);
      break;
    }
    bytes_[end_] = taken[i];
    end_ = (end_ + 1) % capacity;
    ++kept_;
  }
  lost_ += port_.take_lost();
}

void UserUart::next_state() {
  constexpr std::uint32_t most = uart_max_bytes;
  const std::uint32_t waiting = kept_ - told_;
  const std::uint32_t again = told_ - new_;
  const std::uint32_t fresh = waiting < most ? waiting : most;
  new_ = told_;
  told_ += fresh;
  first_ = new_ - (again < most - fresh ? again : most - fresh);
}

void UserUart::tell(UartBytes& out) const {
  out.position = first_;
  out.lost = lost_;
  out.data.size = static_cast<std::uint8_t>(told_ - first_);
  for (std::uint32_t i = 0; i < out.data.size; ++i)
    out.data.bytes[i] = bytes_[place_of(first_ + i)];
}

std::size_t UserUart::place_of(std::uint32_t position) const {
  const std::uint32_t back = kept_ - position;
  return back <= end_ ? end_ - back : end_ + capacity - back;
}

}  // namespace firmware
}  // namespace r4
