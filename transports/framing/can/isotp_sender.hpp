// SPDX-License-Identifier: GPL-3.0-or-later
// Cuts datagrams, one after the other, into ISO-TP frames (ISO 15765-2:2016, 9.2 and 9.3).
//              begin()             its time comes           N_As: send_timeout
//      idle ------------> ready ------------------> offered ------------------> idle
//                          ^  ^                        |
//                          |  |  frame_sent(): STmin   |--- frame_sent(), the last one --> idle
//                          |  '------------------------|
//        clear to send     |                           | frame_sent() of the first frame or the
//                          |                           v last of a block, with flow control
//                          '------------------- waiting --.
//                                                |   ^    | wait: N_Bs restarts
//        overflow, reserved flow status,         |   '----'
//        N_WFTmax, N_Bs                          v
//                                               idle
// The caller's bytes must not change while busy(). Without flow control (telemetry for any number
// of listeners), the frames follow each other at `separation_us`.
//     sender.begin(bytes, size, now);
//     sender.poll(now);
//     while (sender.offer(now, frame) && bus.push(frame)) sender.frame_sent(now);
//     timer.arm(sender.deadline());  // repeat from poll() when a frame arrives or the bus has room
#pragma once

#include <cstdint>

#include "isotp.hpp"

namespace r4 {

struct IsotpSenderOptions {
  IsotpChannel channel;
  std::uint8_t tx_dl = 8;  // longest frame, TX_DL (9.5.1): 8, with FD also 12 … 64
  bool flow_control = true;
  std::uint32_t separation_us = 0;  // least gap of consecutive frames; a receiver may require more
  std::uint32_t n_as_us = 20000;    // the longest offer of a frame
  std::uint32_t n_bs_us = 20000;    // wait for flow control
  std::uint16_t max_waits = 10;     // waits in a row that are accepted
};

// started == datagrams + busy() + the errors that end a transfer.
struct IsotpSenderCounters {
  std::uint32_t started = 0;
  std::uint32_t datagrams = 0;  // last frame accepted by the bus
  std::uint32_t frames = 0;
  // These end a transfer.
  std::uint32_t send_timeout = 0;
  std::uint32_t flow_control_timeout = 0;
  std::uint32_t overflow = 0;
  std::uint32_t invalid_flow_status = 0;
  std::uint32_t too_many_waits = 0;
  std::uint32_t cancelled = 0;
  // These are ignored.
  std::uint32_t unexpected_frame = 0;  // flow control while not waiting for it
  std::uint32_t malformed = 0;         // flow control of fewer than 3 bytes
};

class IsotpSender {
 public:
  // tx_dl is rounded up to a valid size; without FD it is 8.
  explicit IsotpSender(const IsotpSenderOptions& options);

  // Begins a transfer of 1 to 2^32 - 1 bytes. False without effect if busy, or if size is 0.
  bool begin(const void* data, std::uint32_t size, std::uint32_t now_us);
  bool begin(Text datagram, std::uint32_t now_us) {
    return begin(datagram.data(), static_cast<std::uint32_t>(datagram.size()), now_us);
  }
  bool busy() const { return state_ != State::idle; }
  bool awaits_flow_control() const { return state_ == State::waiting; }
  // The error that ended the last transfer; `none` during a transfer and after a complete transfer.
  IsotpError error() const { return error_; }

  // Writes the frame to send; false if there is none. Constant time.
  bool offer(std::uint32_t now_us, CanFrame& frame);
  void frame_sent(std::uint32_t now_us);
  // Restarts N_Bs, or the gap to the next frame, because accepted frames reached the bus only now.
  void wait_anew(std::uint32_t now_us);
  // Takes flow control and ignores other frames. Returns the first error.
  IsotpError on_frame(const CanFrame& frame, std::uint32_t now_us);
  IsotpError poll(std::uint32_t now_us) {
    return state_ < State::offered || !reached(now_us, deadline_us_) ? IsotpError::none
                                                                     : time_out();
  }
  // Ends a transfer, because the interface is down. Later frames are not sent.
  void cancel();

  IsotpDeadline deadline() const { return {busy(), deadline_us_}; }
  const IsotpSenderCounters& counters() const { return counters_; }

 private:
  enum class State : std::uint8_t { idle, ready, offered, waiting };

  std::uint32_t write_start(CanFrame& frame);
  IsotpError on_flow_control(const CanFrame& frame, std::uint32_t now_us);
  IsotpError time_out();
  IsotpError fail(IsotpError error, std::uint32_t& counter);

  IsotpSenderOptions options_;
  const std::uint8_t* data_ = nullptr;
  std::uint32_t size_ = 0;
  std::uint32_t sent_ = 0;         // bytes in accepted frames
  std::uint32_t deadline_us_ = 0;  // ready: earliest offer; otherwise: end of the wait
  std::uint32_t gap_us_ = 0;
  std::uint32_t sent_us_ = 0;  // when the newest frame was accepted
  std::uint8_t chunk_ = 0;     // bytes of the datagram in the offered frame
  std::uint8_t sequence_ = 0;
  std::uint8_t block_left_ = 0;  // frames until the next flow control; 0: unlimited
  std::uint16_t waits_ = 0;
  bool any_consecutive_ = false;
  State state_ = State::idle;
  IsotpError error_ = IsotpError::none;
  IsotpSenderCounters counters_;
};

}  // namespace r4
