// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <string>

#include "board_impl.hpp"
#include "commands/limits.hpp"
#include "devices/device_steps.hpp"
#include "r4link/board.hpp"
#include "r4link/commands/command_text.hpp"

namespace r4 {

namespace {

// Clamped to a range that is wider than the valid range, so that an invalid period stays invalid.
int milliseconds(Board::Duration period) {
  return static_cast<int>(std::clamp<std::int64_t>(period.count(), 0, 1'000'000));
}

}  // namespace

Board::I2c::Bytes Board::I2c::read(int address, const Bytes& register_bytes, int count,
                                   Duration timeout) const {
  const std::string text = hex_of(register_bytes);
  return transfer(Command::i2c_read(address, text, count), timeout);
}

Board::I2c::Bytes Board::I2c::write(int address, const Bytes& bytes, int count,
                                    Duration timeout) const {
  const std::string text = hex_of(bytes);
  return transfer(Command::i2c_write(address, text, count), timeout);
}

Board::I2c::Bytes Board::I2c::scan(Duration timeout) const {
  return transfer(Command::i2c_scan(), timeout);
}

void Board::I2c::poll(int slot, int address, const Bytes& register_bytes, int count,
                      Duration period, Duration timeout) const {
  const std::string text = hex_of(register_bytes);
  board_.send(Command::i2c_poll(slot, address, text, count, milliseconds(period)), timeout);
}

void Board::I2c::poll_off(int slot, Duration timeout) const {
  board_.send(Command::i2c_poll_off(slot), timeout);
}

Board::I2c::Bytes Board::I2c::transfer(const Command& command, Duration timeout) const {
  const auto impl = board_.impl_;
  const std::string text = shown(command);
  impl->require_sendable(OwnCommand(command));
  require_timeout(text, timeout);
  const auto start = [own = OwnCommand(command)](AsyncBoard& board, std::size_t, Duration left,
                                                 auto end) {
    board.async_transfer(own, left, std::move(end));
  };
  const auto part = confirmed(command, impl->run(text, start, timeout));
  const auto& bytes = part->result.transfer.data;
  return {bytes.begin(), bytes.end()};
}

void Board::attach(const Device& device, Duration timeout) {
  const std::string text = device.text();
  require_timeout(text, timeout);
  require_control(role(), text);
  const auto impl = impl_;
  const Duration each = bounded(timeout);
  const auto attach = [device, each](AsyncBoard& board, std::size_t, Duration, auto end) {
    board.async_attach(device, each, std::move(end));
  };
  confirmed(device, impl->run(text, attach, longest(device, each)));
}

}  // namespace r4
