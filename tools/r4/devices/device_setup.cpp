// SPDX-License-Identifier: GPL-3.0-or-later
#include "device_setup.hpp"

#include <chrono>
#include <utility>

#include "host/commands/command_help.hpp"

namespace r4::tool {
namespace {

constexpr AsyncBoard::Duration step_timeout{1000};
constexpr AsyncBoard::Duration look_interval{50};
constexpr AsyncBoard::Duration retry_interval{2000};

}  // namespace

DeviceSetup::DeviceSetup(asio::io_context& io, AsyncBoard& board,
                         const std::vector<Device>& devices,
                         std::function<void(const Problem&)> told)
    : board_(board), told_(std::move(told)), timer_(io) {
  for (const Device& device : devices) {
    board.describe(device);
    for (DeviceStep& step : steps_of(device)) parts_.push_back({&device, std::move(step)});
  }
  subscriptions_.emplace_back(
      board.on_state([this](const ReceivedState& state, const Datagram&) { on_state(state); }));
  subscriptions_.emplace_back(board.on_restart([this] { begin_again(); }));
  look_later(look_interval);
}

void DeviceSetup::after(AsyncBoard::Duration time, void (DeviceSetup::*what)()) {
  timer_.expires_after(time);
  timer_.async_wait([here = std::weak_ptr(here_), what](const std::error_code& error) {
    const auto still = here.lock();
    if (!error && still) ((*still)->*what)();
  });
}

// Is it time to begin, or to begin again?
void DeviceSetup::look() {
  if (!board_.in_control()) {
    running_ = false;
  } else if (!running_) {
    running_ = true;
    next_ = 0;
    do_next();
    return;
  }
  look_later(look_interval);
}

void DeviceSetup::begin_again() {
  running_ = false;
  ++attempt_;
  awaited_pnum_ = 0;
  look_later(look_interval);
}

void DeviceSetup::do_next() {
  if (next_ == parts_.size()) {
    last_told_.clear();
    look_later(look_interval);
    return;
  }
  const std::uint64_t attempt = ++attempt_;
  board_.async_send(parts_[next_].step.command(), step_timeout,
                    [here = std::weak_ptr(here_), attempt](const CommandResult& result) {
                      if (const auto still = here.lock()) (*still)->on_result(result, attempt);
                    });
}

void DeviceSetup::on_result(const CommandResult& result, std::uint64_t attempt) {
  if (attempt != attempt_ || result.outcome == Outcome::closed) return;
  const Part& part = parts_[next_];
  if (result.outcome != Outcome::confirmed) {
    Problem problem = explain(shown(part.step.command()), result, board_.link());
    problem.thing = part.device->text() + ": " + problem.thing;
    fail(problem);
  } else if (part.step.is_answered()) {
    awaited_pnum_ = result.pnum;
    after(step_timeout, &DeviceSetup::on_silence);  // the field I2CX is sent for a second
    on_state(board_.state());
  } else {
    step_done();
  }
}

void DeviceSetup::on_state(const State& state) {
  if (awaited_pnum_ == 0 || state.i2c_answer.pnum != awaited_pnum_) return;
  awaited_pnum_ = 0;
  const Part& part = parts_[next_];
  try {
    require_answer(*part.device, part.step, state.i2c_answer);
  } catch (const Error& error) {
    return fail(error.problem());
  }
  step_done();
}

void DeviceSetup::on_silence() {
  fail({ErrorKind::refused, parts_[next_].device->text(), "the end of a transfer was not heard",
        "give it more time, or look at the field I2CX"});
}

void DeviceSetup::step_done() {
  const std::chrono::milliseconds wait = parts_[next_].step.wait;
  ++next_;
  after(wait, &DeviceSetup::do_next);
}

void DeviceSetup::fail(const Problem& problem) {
  awaited_pnum_ = 0;
  ++attempt_;
  running_ = false;
  if (problem.text() != last_told_) {
    last_told_ = problem.text();
    told_(problem);
  }
  look_later(retry_interval);
}

}  // namespace r4::tool
