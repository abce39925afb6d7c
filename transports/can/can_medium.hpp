// SPDX-License-Identifier: GPL-3.0-or-later
// A SocketCAN socket or a program's own bus, whose first open() may wait. For one thread.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "r4link/can/can_frame.hpp"
#include "r4link/error.hpp"

namespace r4 {

class CanMedium {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::size_t batch = 64;

  struct Received {
    CanFrame frame;           // in an error frame, the data hold the details
    std::uint32_t error = 0;  // the error classes of <linux/can/error.h>; 0 in a data frame
    bool local = false;       // sent on this computer: it proves nothing about the wire
    Clock::time_point at;     // when the kernel received the frame
  };

  enum class Outcome : std::uint8_t {
    done,
    busy,    // the socket's share of the queue is used up: wait until the socket is writable
    full,    // the interface's queue is full; the system does not report room in the queue
    failed,  // with errno
  };

  CanMedium() = default;
  virtual ~CanMedium() = default;
  CanMedium(const CanMedium&) = delete;
  CanMedium& operator=(const CanMedium&) = delete;

  // As shown to users: "can://can0".
  virtual const std::string& name() const = 0;
  // Opens or reopens the medium, which receives no frames before hear(). Throws Error.
  virtual void open() = 0;
  virtual void close() noexcept = 0;
  // The descriptor, readable after frames have arrived or the medium has failed; -1 while closed.
  virtual int number() const = 0;
  // True if there is no controller and no wire: frames arrive as fast as programs send them.
  virtual bool simulated() const { return false; }
  virtual bool heard_rate_switch() const { return false; }
  virtual std::string state() const { return ""; }
  // `error`: errno.
  virtual Problem problem(int error) const = 0;

  // Receives these 11-bit ids (the emergency stop's id includes numbered stops), or frames of every
  // kind. Further frames may arrive. False, with errno, if the kernel refuses; old filters stay.
  [[nodiscard]] virtual bool hear(const std::vector<std::uint32_t>&) { return true; }
  [[nodiscard]] virtual bool hear_everything() { return true; }

  // Takes up to `batch` frames. Returns their number or -errno (EAGAIN: no frame).
  virtual int receive(std::array<Received, batch>& frames) = 0;
  virtual Outcome send(const CanFrame* frames, std::size_t count, std::size_t& sent) = 0;
  // Hands over one frame ahead of all waiting frames except stops.
  virtual Outcome send_first(const CanFrame& frame) = 0;

  // Frames lost because they were not received in time, over all openings.
  virtual std::uint32_t overflows() const = 0;
};

}  // namespace r4
