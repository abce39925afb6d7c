// SPDX-License-Identifier: GPL-3.0-or-later
// Sets described devices up for as long as a command runs: as soon as the board takes our commands, and again when it
// has begun anew, when the link was lost, or when a device was reset. What fails is told once, and
// tried again every two seconds. A command that only watches tells which device was reset, and sets
// none up.
#pragma once

#include <asio/cancellation_signal.hpp>
#include <asio/io_context.hpp>
#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "../boards/timer.hpp"
#include "r4link/async_board.hpp"
#include "r4link/devices/device.hpp"
#include "r4link/error.hpp"

namespace r4::tool {

class DeviceSetup {
 public:
  // `told`: what stands in the way. The board and the devices outlive it, and it lives on their loop.
  DeviceSetup(asio::io_context& io, AsyncBoard& board, const std::vector<Device>& devices,
              std::function<void(const Problem&)> told);
  ~DeviceSetup() { give_up(); }
  DeviceSetup(const DeviceSetup&) = delete;
  DeviceSetup& operator=(const DeviceSetup&) = delete;

 private:
  using Clock = std::chrono::steady_clock;
  // Of each device, whatever becomes of the others.
  struct Progress {
    bool done = false;
    Clock::time_point again{};    // it has failed, and is not tried before
    std::string told;             // why
    Clock::time_point settled{};  // it was set up, and has measured by then
    bool reset = false;           // it was told that the device is not set up any more
  };
  void look_later();
  void look();
  void look_for_resets();
  void begin_again();
  void give_up();
  bool begin_next(std::size_t from);
  void on_result(const CommandResult& result);
  void tell(const CommandResult& result);

  AsyncBoard& board_;
  const std::vector<Device>& devices_;
  std::function<void(const Problem&)> told_;
  Timer timer_;
  std::vector<Progress> progress_;
  std::size_t next_ = 0;  // that is set up now
  ScopedSubscription restarts_;
  std::shared_ptr<asio::cancellation_signal> attempt_;  // results of earlier ones do not count
  const std::shared_ptr<DeviceSetup*> here_ = std::make_shared<DeviceSetup*>(this);
};

}  // namespace r4::tool
