// SPDX-License-Identifier: GPL-3.0-or-later
#include "device_setup.hpp"

#include <algorithm>
#include <asio/bind_cancellation_slot.hpp>
#include <chrono>
#include <utility>

namespace r4::tool {
namespace {

constexpr AsyncBoard::Duration step_timeout{1000};
constexpr AsyncBoard::Duration look_interval{50};
constexpr std::chrono::milliseconds retry_interval{2000};
constexpr std::chrono::milliseconds settle_time{500};  // from setup to the first measurement

}  // namespace

DeviceSetup::DeviceSetup(asio::io_context& io, AsyncBoard& board,
                         const std::vector<Device>& devices,
                         std::function<void(const Problem&)> told)
    : board_(board),
      devices_(devices),
      told_(std::move(told)),
      timer_(io),
      progress_(devices.size()) {
  for (const Device& device : devices) board.describe(device);
  restarts_ = board.on_restart([this] { begin_again(); });
  look_later();
}

void DeviceSetup::look_later() {
  timer_.after(look_interval, [this] { look(); });
}

void DeviceSetup::look() {
  look_for_resets();
  if (!board_.in_control()) {
    for (Progress& each : progress_) each.done = false;
  } else if (begin_next(0)) {
    return;
  }
  look_later();
}

void DeviceSetup::look_for_resets() {
  const bool in_control = board_.in_control();
  for (std::size_t i = 0; i < devices_.size(); ++i) {
    Progress& progress = progress_[i];
    if (in_control && (!progress.done || Clock::now() < progress.settled)) continue;
    const std::optional<bool> is_set_up = devices_[i].is_set_up(board_.state());
    if (is_set_up == true) progress.reset = false;
    if (is_set_up != false) continue;
    if (!progress.reset) {
      told_({ErrorKind::refused, devices_[i].text(),
             "it is not set up, as after a reset, so its values are not measurements",
             in_control
                 ? "check its supply and wires if this repeats; r4 now sets it up again"
                 : "add this device to the program that controls the board, which then sets it up",
             Outcome::refused});
    }
    progress.reset = !in_control;  // after a new setup the next reset is reported
    progress.done = false;
  }
}

void DeviceSetup::begin_again() {
  give_up();
  for (Progress& each : progress_) each = Progress();
  look_later();
}

void DeviceSetup::give_up() {
  if (const auto attempt = std::move(attempt_)) attempt->emit(asio::cancellation_type::terminal);
}

bool DeviceSetup::begin_next(std::size_t from) {
  const Clock::time_point now = Clock::now();
  const auto is_due = [now](const Progress& each) { return !each.done && now >= each.again; };
  const auto first = progress_.begin() + static_cast<std::ptrdiff_t>(from);
  next_ =
      static_cast<std::size_t>(std::find_if(first, progress_.end(), is_due) - progress_.begin());
  if (next_ == devices_.size()) return false;
  attempt_ = std::make_shared<asio::cancellation_signal>();
  board_.async_attach(devices_[next_], step_timeout,
                      asio::bind_cancellation_slot(
                          attempt_->slot(), [here = std::weak_ptr(here_),
                                             attempt = attempt_](const CommandResult& result) {
                            const auto still = here.lock();
                            if (still && (*still)->attempt_ == attempt) (*still)->on_result(result);
                          }));
  return true;
}

void DeviceSetup::on_result(const CommandResult& result) {
  if (result.outcome == Outcome::closed) return;
  Progress& progress = progress_[next_];
  progress.done = result.outcome == Outcome::confirmed;
  if (progress.done) {
    progress.settled = Clock::now() + settle_time;
    progress.told.clear();
  } else {
    progress.again = Clock::now() + retry_interval;
    tell(result);
  }
  if (!board_.in_control() || !begin_next(next_ + 1)) look_later();
}

void DeviceSetup::tell(const CommandResult& result) {
  const Device& device = devices_[next_];
  const Problem problem =
      result.outcome == Outcome::not_armed
          ? Problem{ErrorKind::refused, device.text(), "it is not set up before the board is armed",
                    "arm the board: setting up a device may move something"}
          : explain(device, result, board_.link());
  std::string text = problem.text();
  if (progress_[next_].told == text) return;
  progress_[next_].told = std::move(text);
  told_(problem);
}

}  // namespace r4::tool
