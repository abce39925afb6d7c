// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <string>
#include <utility>

#include "../board_impl.hpp"
#include "../commands/limits.hpp"
#include "../devices/device_steps.hpp"
#include "r4link/board.hpp"
#include "r4link/tables/state_fields.hpp"

namespace r4 {

Board::Uart Board::uart(int channel) {
  if (channel < 1 || channel > uart_channels) {
    throw Error(ErrorKind::usage, fmt::format("uart({})", channel), "the UART does not exist",
                fmt::format("give 1 to {}", uart_channels));
  }
  return {*this, channel};
}

void Board::Uart::write(const std::vector<std::uint8_t>& bytes, Duration timeout) const {
  const std::string text = hex_of(bytes);
  board_.send(Command::uart_write(channel_, text), timeout);
}

Board::UartData Board::Uart::read(Duration timeout) const {
  require_wait(fmt::format("uart({}).read()", channel_), timeout);
  const auto impl = board_.impl_;
  UartData& waiting = impl->uarts[channel_ - 1].to_read;
  UartData taken;
  impl->wait_for_news(timeout, [&] {
    if (waiting.bytes.empty() && waiting.lost == 0) return false;
    taken = std::exchange(waiting, {});
    return true;
  });
  return taken;
}

Subscription Board::Uart::on_bytes(std::function<void(const UartData&)> callback) const {
  const auto impl = board_.impl_;
  {
    const std::lock_guard lock(impl->mutex);
    impl->uarts[channel_ - 1].reports = true;
  }
  return impl->callbacks.add_uart(channel_, std::move(callback));
}

void Board::dac(Channel channel, Millivolts voltage, Duration timeout) {
  send(Command::dac(channel, voltage), timeout);
}

void Board::Impl::take_uarts(const State& fresh) {
  for (int i = 0; i < uart_channels; ++i) {
    if (!fresh.present.has(state_field(FieldKind::uart, i + 1))) continue;
    std::unique_lock lock(mutex);
    UartInbox& inbox = uarts[i];
    const bool reports = inbox.reports;
    const bool any = reports ? inbox.stream.take(fresh.raw.uart[i], inbox.to_read, inbox.to_report)
                             : inbox.stream.take(fresh.raw.uart[i], inbox.to_read);
    lock.unlock();
    if (!any) continue;
    news.notify_all();
    if (reports) callbacks.notify(CallbackThread::UartNews{i + 1});
  }
}

}  // namespace r4
