// SPDX-License-Identifier: GPL-3.0-or-later
// A raw SocketCAN socket on one interface: frames in batches with the time at which they came, the
// controller's error frames apart, and sends that never wait. The kernel filters what it hears.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "../file_descriptor.hpp"
#include "r4link/can/can_frame.hpp"
#include "r4link/error.hpp"

namespace r4 {

// What an errno of a socket on that interface means, with the fix where there is one.
Problem can_problem(const std::string& interface, int error);

class CanSocket {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::size_t batch = 64;

  CanSocket();
  ~CanSocket();
  CanSocket(const CanSocket&) = delete;
  CanSocket& operator=(const CanSocket&) = delete;

  struct Received {
    CanFrame frame;           // of an error frame, the data hold its details
    std::uint32_t error = 0;  // the error classes of <linux/can/error.h>; 0 in a data frame
    bool local = false;       // sent on this computer: it proves nothing about the wire
    Clock::time_point at;     // when the kernel got it
  };

  enum class Outcome : std::uint8_t {
    done,    // everything was taken
    busy,    // the socket's share of the queue is used up: wait until it is writable
    full,    // the interface's queue is full: the system does not report when it has room
    failed,  // with errno
  };

  // Opens it on `interface`; it hears nothing yet. With `fd`, CAN FD frames can be sent. Throws
  // Error: unsupported if this kernel has no CAN or there is no such interface, open if the
  // interface is down, is not CAN or does not do CAN FD, permission.
  void open(const std::string& interface, bool fd);
  void close() noexcept;
  int number() const { return descriptor_.get(); }
  // True without a controller and a wire: frames come as fast as programs make them.
  bool simulated() const { return simulated_; }
  // True if a CAN FD frame came whose data have a bit rate of their own (BRS).
  bool heard_rate_switch() const { return heard_rate_switch_; }

  // Hears the frames with exactly these 11-bit ids (the id of the emergency stop includes the stops
  // with a number), or everything, extended and remote frames too. False, with errno, if the kernel
  // does not take that; then it hears what it heard before.
  [[nodiscard]] bool hear(const std::vector<std::uint32_t>& ids);
  [[nodiscard]] bool hear_everything();

  // Takes up to `batch` frames; returns how many, or -errno (EAGAIN: none is there).
  int receive(std::array<Received, batch>& frames);
  // Hands frames over in order. Sets `sent` to the number of frames that were taken.
  Outcome send(const CanFrame* frames, std::size_t count, std::size_t& sent);
  // Hands one frame over ahead of everything that waits in the interface's queue.
  Outcome send_first(const CanFrame& frame);

  // Frames that were lost because the socket's buffer was full, over all openings.
  std::uint32_t overflows() const { return overflows_before_ + overflows_; }

 private:
  struct Inbox;
  FileDescriptor descriptor_;
  FileDescriptor first_;  // with a priority and a queue of its own
  bool simulated_ = false;
  bool heard_rate_switch_ = false;
  std::uint32_t overflows_ = 0;         // of this opening
  std::uint32_t overflows_before_ = 0;  // of earlier openings
  const std::unique_ptr<Inbox> inbox_;
};

}  // namespace r4
