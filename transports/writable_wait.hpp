// SPDX-License-Identifier: GPL-3.0-or-later
// Waits until a descriptor takes bytes again.
//
// It waits on a duplicate that lives only as long as there is something to wait for: asked once,
// Asio's reactor reports "writable" for a descriptor for good, which would cost a wake-up with each
// datagram that is received.
#pragma once

#include <fcntl.h>

#include <asio/io_context.hpp>
#include <utility>

#include "operation_slot.hpp"

namespace r4 {

class WritableWait {
 public:
  explicit WritableWait(asio::io_context& io) : duplicate_(io) {}

  // Calls `function()` once, when `descriptor` is writable. Does nothing if a call is due already.
  template <class Function>
  void start(int descriptor, Function function) {
    if (waiting_) return;
    asio::error_code error;
    if (!duplicate_.is_open()) {
      duplicate_.assign(::fcntl(descriptor, F_DUPFD_CLOEXEC, 0), error);
      if (error) return;
    }
    waiting_ = true;
    duplicate_.async_wait(asio::posix::descriptor_base::wait_write,
                          slot_.handler([this, call = std::move(function)] {
                            waiting_ = false;
                            call();
                          }));
  }

  // Nothing waits any more.
  void stop() {
    waiting_ = false;
    slot_.cancel();
    asio::error_code ignored;
    duplicate_.close(ignored);
  }

 private:
  LoopDescriptor duplicate_;
  OperationSlot slot_;
  bool waiting_ = false;
};

}  // namespace r4
