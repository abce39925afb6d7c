// SPDX-License-Identifier: GPL-3.0-or-later
#include <cstring>

#include "../../protocol/messages/device_command.hpp"
#include "application.hpp"

namespace r4 {
namespace firmware {

Refusal Application::carry_out_device(std::uint32_t pnum, const Command& command,
                                      std::uint32_t now_ms) {
  if (command.kind == CommandKind::uart_write) return write_uart(command);
  if (i2c_ == nullptr) return Refusal::unknown;
  if (command.kind == CommandKind::i2c_poll || command.kind == CommandKind::i2c_poll_off) {
    i2c_->poll_slot(command.channel, poll_of(command), now_ms);
    return Refusal::none;
  }
  return i2c_->ask(pnum, command) ? Refusal::none : Refusal::full;
}

Refusal Application::write_uart(const Command& command) {
  UserUart* const uart = uarts_[command.channel - 1];
  if (uart == nullptr) return Refusal::unknown;
  if (!uart->on()) return Refusal::channel;
  std::uint8_t bytes[uart_max_write];
  std::uint8_t size = 0;
  parse_bytes(command.text, bytes, sizeof bytes, size);
  return uart->write(bytes, size) ? Refusal::none : Refusal::full;
}

void Application::drop_device_writes() {
  if (i2c_ != nullptr) i2c_->drop_write();
  for (UserUart* uart : uarts_) {
    if (uart != nullptr) uart->drop_writes();
  }
}

void Application::forget_uarts() {
  for (UserUart* uart : uarts_) {
    if (uart != nullptr) uart->forget();
  }
}

void Application::begin_devices(std::uint32_t now_ms) {
  has_answer_ = false;
  for (UserUart* uart : uarts_) {
    if (uart != nullptr) uart->drop_writes();
  }
  forget_uarts();
  if (i2c_ == nullptr) return;
  i2c_->drop_all();
  for (int i = 0; i < i2c_slots; ++i) i2c_->poll_slot(i + 1, setpoints_.settings.polls[i], now_ms);
}

void Application::follow_device_setting(Text key, std::uint32_t now_ms) {
  const FoundSetting found = find_setting(key);
  const int i = found.number - 1;
  if (found.row->setting == Setting::uart && uarts_[i] != nullptr) {
    uarts_[i]->set_up(setpoints_.settings.uarts[i]);
  }
  if (found.row->setting == Setting::i2c && i2c_ != nullptr) {
    i2c_->poll_slot(found.number, setpoints_.settings.polls[i], now_ms);
  }
}

void Application::poll_devices(std::uint32_t now_ms) {
  for (UserUart* uart : uarts_) {
    if (uart != nullptr) uart->poll();
  }
  if (i2c_ == nullptr) return;
  i2c_->poll(now_ms);
  if (now_ms - answered_ms_ > 2 * answer_shown_ms) has_answer_ = false;
  if (!i2c_->take_answered()) return;
  has_answer_ = true;
  answered_ms_ = now_ms;
}

void Application::add_device_answer(FieldSet& fields, std::uint32_t t_ms) const {
  if (has_answer_ && reached(answered_ms_ + answer_shown_ms, t_ms)) {
    fields.add(StateField::i2cx);
  }
}

void Application::fill_devices(State& state) const {
  for (int i = 0; i < uart_channels; ++i) {
    if (uarts_[i] != nullptr) uarts_[i]->tell(state.raw.uart[i]);
  }
  if (i2c_ == nullptr) return;
  std::memcpy(state.raw.i2c, i2c_->readings(), sizeof state.raw.i2c);
  state.i2c_answer = i2c_->answer();
  state.i2c_bus = i2c_->report();
}

}  // namespace firmware
}  // namespace r4
