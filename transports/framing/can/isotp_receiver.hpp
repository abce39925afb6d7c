// SPDX-License-Identifier: GPL-3.0-or-later
// Joins ISO-TP frames to datagrams (ISO 15765-2:2016, 9.2 and 9.3), in a buffer of the caller's.
//
//           first frame           offer()            frame_sent(): clear to send
//     idle -------------> owing ----------> offered ------------------------------> receiving
//       |                 ^   ^                |                                    |   |   ^
//       |                 |   '----------------'                                    |   '---'
//       |                 |    frame_sent(): wait          the last one of a block  |   consecutive
//       |                 '---------------------------------------------------------'   frame
//       |                          first frame, listen only                         ^
//       '---------------------------------------------------------------------------'
//
//     receiving -> idle: the last frame (a datagram), a wrong sequence number, N_Cr
//     offered   -> idle: N_Ar; the overflow was told
//     owing     -> idle: too many waits
//     any       -> idle, owing, receiving: a single or a first frame replaces what is unfinished
//
// A receiver that listens only (telemetry, a bus monitor) never sends and passes over flow control.
//
//     const IsotpArrival arrival = receiver.on_frame(frame, now);
//     if (arrival.datagram) use(receiver.text());
//     receiver.poll(now);  // also when the timer rings
//     if (receiver.offer(now, answer) && bus.push(answer)) receiver.frame_sent(now);
//     timer.arm(receiver.deadline());
//
// Promise: what is delivered is what was sent, or nothing and a counted error; with one exception
// that ISO-TP has, as it tells frames apart by four bits only. A frame that is 16 (32, 48 …) places
// further on in the same stream passes for the one expected.
//
// Loss alone brings that about only without flow control and only over the border of two transfers:
// if the end of one, the first frame of the next and as many after it are lost that the numbers fit,
// and all within N_Cr, then the datagram is made of both. Where both have n frames that is a run of n
// lost ones, or of n - 16, n - 32 …, but at least of 2: 4 where both have 4, 9 where both have 25, and
// 2 where both have 18. An N_Cr below the pause between transfers excludes it.
//
// With flow control it takes a flow control that comes later than N_Bs, after its sender has given up
// and begun another transfer, whose first frame is lost. The CRC of the datagram finds both.
#pragma once

#include <cstdint>

#include "isotp.hpp"

namespace r4 {

struct IsotpReceiverOptions {
  IsotpChannel channel;
  bool listen_only = false;       // never send flow control
  std::uint8_t block_size = 0;    // BS: frames between two flow controls; 0: all in one block
  std::uint8_t stmin = 0;         // STmin as on the wire, see stmin_from_us()
  std::uint32_t n_ar_us = 20000;  // our flow control is offered at most that long
  // Wait for a consecutive frame: a process that sends may be held up, and so may the system
  // that tells when a frame came. A new first frame ends a transfer at any time.
  std::uint32_t n_cr_us = 100000;
  std::uint16_t max_waits = 10;       // N_WFTmax: waits in a row while hold(true)
  std::uint32_t wait_gap_us = 10000;  // between them: less than the sender's N_Bs
};

// started == datagrams + busy() + the errors that end a transfer
// frames == started + consecutive + wrong_sequence_number + overflow + unexpected_frame + malformed
struct IsotpReceiverCounters {
  std::uint32_t frames = 0;       // of our id, without flow control
  std::uint32_t started = 0;      // single and first frames taken
  std::uint32_t consecutive = 0;  // consecutive frames taken
  std::uint32_t datagrams = 0;    // delivered
  // What ended a transfer.
  std::uint32_t send_timeout = 0;
  std::uint32_t consecutive_timeout = 0;
  std::uint32_t wrong_sequence_number = 0;
  std::uint32_t interrupted = 0;
  std::uint32_t too_many_waits = 0;
  std::uint32_t cancelled = 0;
  // What was refused or ignored.
  std::uint32_t overflow = 0;          // a datagram longer than the buffer
  std::uint32_t refusal_timeout = 0;   // of those, the sender could not be told: N_Ar
  std::uint32_t unexpected_frame = 0;  // a consecutive frame that belongs to no transfer
  std::uint32_t malformed = 0;
};

struct IsotpArrival {
  bool datagram;     // complete: data(), size(), valid up to the next on_frame()
  IsotpError error;  // the first of several; a datagram can complete beside it (interrupted)
};

class IsotpReceiver {
 public:
  // `buffer` holds the datagram while it grows: `capacity` bytes, max_datagram for ours.
  IsotpReceiver(const IsotpReceiverOptions& options, void* buffer, std::uint32_t capacity);

  // Takes a frame; one with another id, and flow control, is passed over. Constant time.
  IsotpArrival on_frame(const CanFrame& frame, std::uint32_t now_us);
  // Writes the flow control to send now; false: none.
  bool offer(std::uint32_t now_us, CanFrame& frame);
  // The offered frame was accepted. Without one: nothing happens.
  void frame_sent(std::uint32_t now_us);
  // Ends a transfer that has timed out, and tells of it.
  IsotpError poll(std::uint32_t now_us) {
    return state_ == State::idle || !reached(now_us, deadline_us_) ? IsotpError::none : time_out();
  }
  // While held, the sender is told to wait instead of to send, max_waits times; then the transfer
  // ends (9.7). Has no effect on a sender that has been cleared to send.
  void hold(bool held, std::uint32_t now_us);
  // Ends a transfer (the interface went down).
  void cancel();

  // Is a transfer unfinished?
  bool busy() const { return state_ != State::idle && !refusing(); }
  // Is a consecutive frame the next?
  bool awaits_consecutive() const { return state_ == State::receiving; }
  // The datagram that on_frame() has told of.
  const std::uint8_t* data() const { return buffer_; }
  std::uint32_t size() const { return size_; }
  Text text() const { return Text(reinterpret_cast<const char*>(buffer_), size_); }

  IsotpDeadline deadline() const { return {state_ != State::idle, deadline_us_}; }
  const IsotpReceiverCounters& counters() const { return counters_; }

 private:
  enum class State : std::uint8_t { idle, owing, offered, receiving };

  IsotpArrival on_single(const CanFrame& frame);
  IsotpArrival on_first(const CanFrame& frame, std::uint32_t now_us);
  IsotpArrival on_consecutive(const CanFrame& frame, std::uint32_t now_us);
  IsotpArrival malformed();
  IsotpError replace();
  IsotpError refuse(IsotpError error);
  IsotpError time_out();
  IsotpError fail(IsotpError error, std::uint32_t& counter);
  void rest();
  void owe(IsotpFlowStatus status, std::uint32_t now_us);
  bool refusing() const { return status_ == IsotpFlowStatus::overflow; }

  IsotpReceiverOptions options_;
  std::uint8_t* buffer_;
  std::uint32_t capacity_;
  std::uint32_t size_ = 0;
  std::uint32_t received_ = 0;
  std::uint32_t deadline_us_ = 0;  // owing: when it may be offered; else: when the wait ends
  std::uint8_t rx_dl_ = 0;         // size of the first frame (9.5.4)
  std::uint8_t sequence_ = 0;      // of the next consecutive frame
  std::uint8_t block_left_ = 0;    // frames before we owe flow control; 0: no end
  std::uint16_t waits_ = 0;        // sent in a row
  bool held_ = false;
  State state_ = State::idle;
  IsotpFlowStatus status_ = IsotpFlowStatus::clear_to_send;  // of the flow control that we owe
  IsotpReceiverCounters counters_;
};

}  // namespace r4
