// SPDX-License-Identifier: GPL-3.0-or-later
// Waits until a descriptor is writable, on a duplicate that is open only during the wait. After one
// wait on a descriptor, Asio's reactor reports "writable" for ever, which costs a wake-up per
// received datagram. A process without a free descriptor polls instead.
#pragma once

#include <fcntl.h>

#include <asio/io_context.hpp>
#include <chrono>
#include <utility>

#include "file_descriptor.hpp"
#include "operation_slot.hpp"

namespace r4 {

class WritableWait {
 public:
  explicit WritableWait(asio::io_context& io) : duplicate_(io), timer_(io) {}

  // Calls `function()` once, when `descriptor` may be writable. No effect while a call is due.
  template <class Function>
  void start(int descriptor, Function function) {
    if (waiting_) return;
    waiting_ = true;
    auto handler = slot_.handler([this, call = std::move(function)] {
      waiting_ = false;
      call();
    });
    const auto duplicate = [&] { return FileDescriptor(::fcntl(descriptor, F_DUPFD_CLOEXEC, 0)); };
    if (duplicate_.is_open() || give_to_loop(duplicate_, duplicate())) {
      duplicate_.async_wait(asio::posix::descriptor_base::wait_write, std::move(handler));
    } else {
      timer_.expires_after(look_again);
      timer_.async_wait(std::move(handler));
    }
  }

  void stop() {
    waiting_ = false;
    slot_.cancel();
    asio::error_code ignored;
    duplicate_.close(ignored);
  }

 private:
  static constexpr std::chrono::milliseconds look_again{1};

  LoopDescriptor duplicate_;
  LoopTimer timer_;
  OperationSlot slot_;
  bool waiting_ = false;
};

}  // namespace r4
