// SPDX-License-Identifier: GPL-3.0-or-later
// What a CanBus sends and receives frames on: a socket of SocketCAN, or a bus of a program's own. For
// the thread of one event loop. No function waits, except open().
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

  CanMedium() = default;
  virtual ~CanMedium() = default;
  CanMedium(const CanMedium&) = delete;
  CanMedium& operator=(const CanMedium&) = delete;

  // For people: "can://can0".
  virtual const std::string& name() const = 0;
  // Opens it, also again; it hears nothing yet. Throws Error.
  virtual void open() = 0;
  virtual void close() noexcept = 0;
  // Readable when frames have come, or it has failed; -1 while it is closed.
  virtual int number() const = 0;
  // True without a controller and a wire: frames come as fast as programs make them.
  virtual bool simulated() const { return false; }
  // True if a CAN FD frame came whose data have a bit rate of their own (BRS).
  virtual bool heard_rate_switch() const { return false; }
  // The state of its controller, as far as it is known: CanInterface::state.
  virtual std::string state() const { return ""; }
  // The meaning of that errno.
  virtual Problem problem(int error) const = 0;

  // Hears the frames with exactly these 11-bit ids (the id of the emergency stop includes the stops
  // with a number), or everything, extended and remote frames too. It may hear more. False, with
  // errno, if the kernel does not take that; then it hears what it heard before.
  [[nodiscard]] virtual bool hear(const std::vector<std::uint32_t>&) { return true; }
  [[nodiscard]] virtual bool hear_everything() { return true; }

  // Takes up to `batch` frames; returns how many, or -errno (EAGAIN: none is there).
  virtual int receive(std::array<Received, batch>& frames) = 0;
  // Hands frames over in order. Sets `sent` to the number of frames that were taken.
  virtual Outcome send(const CanFrame* frames, std::size_t count, std::size_t& sent) = 0;
  // Hands one frame over ahead of everything that waits.
  virtual Outcome send_first(const CanFrame& frame) = 0;

  // Frames that were lost because nobody took them in time, over all openings.
  virtual std::uint32_t overflows() const = 0;
};

}  // namespace r4
