// SPDX-License-Identifier: GPL-3.0-or-later
// Sets described devices up for as long as a command runs: as soon as the board takes our commands, and again when it
// has begun anew or the link was lost. What fails is told once, and tried again every two seconds.
#pragma once

#include <asio/io_context.hpp>
#include <asio/steady_timer.hpp>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "host/devices/device_steps.hpp"
#include "r4link/async_board.hpp"
#include "r4link/devices/device.hpp"
#include "r4link/error.hpp"

namespace r4::tool {

class DeviceSetup {
 public:
  // `told`: what stands in the way. The board and the devices outlive it, and it lives on their loop.
  DeviceSetup(asio::io_context& io, AsyncBoard& board, const std::vector<Device>& devices,
              std::function<void(const Problem&)> told);

 private:
  struct Part {
    const Device* device = nullptr;
    DeviceStep step;
  };
  // As timer_ has expired, unless it is gone by then.
  void after(AsyncBoard::Duration time, void (DeviceSetup::*what)());
  void look_later(AsyncBoard::Duration time) { after(time, &DeviceSetup::look); }
  void look();
  void begin_again();
  void do_next();
  void on_result(const CommandResult& result, std::uint64_t attempt);
  void on_state(const State& state);
  void on_silence();
  void step_done();
  void fail(const Problem& problem);

  AsyncBoard& board_;
  std::function<void(const Problem&)> told_;
  std::vector<Part> parts_;
  asio::steady_timer timer_;
  bool running_ = false;
  std::size_t next_ = 0;            // of the parts
  std::uint64_t attempt_ = 0;       // results of earlier ones do not count
  std::uint32_t awaited_pnum_ = 0;  // whose answer is to come; 0: none
  std::string last_told_;
  std::vector<ScopedSubscription> subscriptions_;
  const std::shared_ptr<DeviceSetup*> here_ = std::make_shared<DeviceSetup*>(this);
};

}  // namespace r4::tool
