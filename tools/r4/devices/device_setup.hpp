// SPDX-License-Identifier: GPL-3.0-or-later
// Sets described devices up after taking control, a restart of the board, a lost link or a device
// reset. A failure is reported once and retried every two seconds. A watcher only reports resets.
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
  // `told` gets problems. The board and the devices must outlive this object.
  DeviceSetup(asio::io_context& io, AsyncBoard& board, const std::vector<Device>& devices,
              std::function<void(const Problem&)> told);
  ~DeviceSetup() { give_up(); }
  DeviceSetup(const DeviceSetup&) = delete;
  DeviceSetup& operator=(const DeviceSetup&) = delete;

 private:
  using Clock = std::chrono::steady_clock;
  struct Progress {
    bool done = false;
    Clock::time_point again{};  // after a failure: earliest time of the next attempt
    std::string told;
    Clock::time_point settled{};  // after setup: by then the device has measured
    bool reset = false;           // the reset of the device has been reported
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
  std::size_t next_ = 0;
  ScopedSubscription restarts_;
  std::shared_ptr<asio::cancellation_signal> attempt_;  // results of earlier attempts are ignored
  const std::shared_ptr<DeviceSetup*> here_ = std::make_shared<DeviceSetup*>(this);
};

}  // namespace r4::tool
