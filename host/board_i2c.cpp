// SPDX-License-Identifier: GPL-3.0-or-later
// The devices on the user's I2C bus: a command, and its answer, which comes with the state; the
// set-up of a described device.
#include <algorithm>
#include <string>

#include "board_impl.hpp"
#include "commands/command_help.hpp"
#include "commands/limits.hpp"
#include "devices/device_steps.hpp"
#include "r4link/board.hpp"
#include "r4link/commands/command_text.hpp"

namespace r4 {

namespace {

// A period that a command cannot hold stays out of range.
int milliseconds(Board::Duration period) {
  return static_cast<int>(std::clamp<std::int64_t>(period.count(), 0, 1'000'000));
}

}  // namespace

Board::I2c::Bytes Board::I2c::read(int address, const Bytes& register_bytes, int count,
                                   Duration timeout) const {
  const std::string text = hex_of(register_bytes);
  return answer(Command::i2c_read(address, text, count), timeout);
}

Board::I2c::Bytes Board::I2c::write(int address, const Bytes& bytes, int count,
                                    Duration timeout) const {
  const std::string text = hex_of(bytes);
  return answer(Command::i2c_write(address, text, count), timeout);
}

Board::I2c::Bytes Board::I2c::scan(Duration timeout) const {
  return answer(Command::i2c_scan(), timeout);
}

void Board::I2c::poll(int slot, int address, const Bytes& register_bytes, int count,
                      Duration period, Duration timeout) const {
  const std::string text = hex_of(register_bytes);
  board_.send(Command::i2c_poll(slot, address, text, count, milliseconds(period)), timeout);
}

void Board::I2c::poll_off(int slot, Duration timeout) const {
  board_.send(Command::i2c_poll_off(slot), timeout);
}

I2cAnswer Board::I2c::ask(const Command& command, Duration timeout) const {
  const auto impl = board_.impl_;
  const std::string text = shown(command);
  const auto deadline = Impl::Clock::now() + Impl::bounded(timeout);
  const std::uint32_t pnum = impl->execute(command, timeout)->result.pnum;
  I2cAnswer found;
  const auto left = std::chrono::ceil<Duration>(deadline - Impl::Clock::now());
  const bool answered = impl->wait_for_news(std::max(left, Duration{0}), [&] {
    found = impl->state.i2c_answer;
    return found.pnum == pnum;
  });
  if (!answered) {
    throw Error(ErrorKind::refused, text, "was begun, and its end was not heard in time",
                "give it more time, or look at the field I2CX");
  }
  return found;
}

Board::I2c::Bytes Board::I2c::answer(const Command& command, Duration timeout) const {
  const I2cAnswer found = ask(command, timeout);
  if (found.outcome != I2cOutcome::done) {
    Problem problem = failed_transfer(shown(command), found.outcome);
    problem.outcome = Outcome::refused;
    throw Error(std::move(problem));
  }
  return {found.data.begin(), found.data.end()};
}

void Board::attach(const Device& device, Duration timeout) {
  const std::string text = device.text();
  require_timeout(text, timeout);
  const auto impl = impl_;
  impl->require_control(text);
  const Duration each = Impl::bounded(timeout);
  const auto attach = [device, each](AsyncBoard& board, std::size_t, Duration, auto end) {
    board.async_attach(device, each, std::move(end));
  };
  const auto part = impl->run(text, attach, longest(device, each));
  if (part->result.outcome == Outcome::confirmed) return;
  throw Error(explain(device, part->result, part->link));
}

}  // namespace r4
