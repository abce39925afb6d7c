// SPDX-License-Identifier: GPL-3.0-or-later
// Joins ISO-TP frames to datagrams (ISO 15765-2:2016, 9.2 and 9.3), in the caller's buffer.
//           first frame           offer()            frame_sent(): clear to send
//     idle -------------> owing ----------> offered ------------------------------> receiving
//       |                 ^   ^                |                                    |   |   ^
//       |                 |   '----------------'                                    |   '---'
//       |                 |    frame_sent(): wait            a block's last frame   |   consecutive
//       |                 '---------------------------------------------------------'   frame
//       |                          first frame, listen only                         ^
//       '---------------------------------------------------------------------------'
//     receiving -> idle: the last frame (a datagram), a wrong sequence number, N_Cr
//     offered   -> idle: N_Ar; the overflow was sent
//     owing     -> idle: too many waits
//     any       -> idle, owing, receiving: a single or first frame replaces an unfinished transfer
// A receiver that only listens (telemetry, a bus monitor) never sends, and ignores flow control.
//     const IsotpArrival arrival = receiver.on_frame(frame, now);
//     if (arrival.datagram) use(receiver.text());
//     receiver.poll(now);  // also when the timer expires
//     if (receiver.offer(now, answer) && bus.push(answer)) receiver.frame_sent(now);
//     timer.arm(receiver.deadline());
// A delivered datagram equals the sent datagram. Any error is counted and delivers nothing. There
// is one exception, because ISO-TP distinguishes frames by four bits only. A frame 16 (32, 48 …)
// places later in the same stream is accepted as the expected frame. The datagram's CRC detects
// the exception.
//   Without flow control, the exception needs the loss of the end of one transfer, the first frame
//   of the next transfer, and as many further frames as the numbers need, all within N_Cr. If both
//   transfers have n frames, n (or n - 16, n - 32 …, but at least 2) frames in a row are lost. With
//   18 frames: frame 18 of a transfer and frame 1 of the next. The datagram mixes both transfers.
//   An N_Cr below the pause of transfers prevents this.
//   With flow control, the exception needs a flow control that arrives after N_Bs. By then the
//   sender has begun another transfer, whose first frame is lost, too.
#pragma once

#include <cstdint>

#include "isotp.hpp"

namespace r4 {

struct IsotpReceiverOptions {
  IsotpChannel channel;
  bool listen_only = false;       // never send flow control
  std::uint8_t block_size = 0;    // BS: frames between two flow controls; 0: all in one block
  std::uint8_t stmin = 0;         // STmin byte, see stmin_from_us()
  std::uint32_t n_ar_us = 20000;  // the longest offer of a flow control
  // Long: the sender or the report of an arrival may be late. A first frame ends a transfer anyway.
  std::uint32_t n_cr_us = 100000;
  std::uint16_t max_waits = 10;       // N_WFTmax: waits in a row while hold(true)
  std::uint32_t wait_gap_us = 10000;  // gap of waits: less than the sender's N_Bs
};

// started == datagrams + busy() + the errors that end a transfer
// frames == started + consecutive + wrong_sequence_number + overflow + unexpected_frame + malformed
struct IsotpReceiverCounters {
  std::uint32_t frames = 0;   // with this id, except flow control
  std::uint32_t started = 0;  // single and first frames accepted
  std::uint32_t consecutive = 0;
  std::uint32_t datagrams = 0;
  // Events that end a transfer.
  std::uint32_t send_timeout = 0;
  std::uint32_t consecutive_timeout = 0;
  std::uint32_t wrong_sequence_number = 0;
  std::uint32_t interrupted = 0;
  std::uint32_t too_many_waits = 0;
  std::uint32_t cancelled = 0;
  // Frames that are refused or ignored.
  std::uint32_t overflow = 0;          // a datagram longer than the buffer
  std::uint32_t refusal_timeout = 0;   // part of `overflow`: not answered within N_Ar
  std::uint32_t unexpected_frame = 0;  // a consecutive frame that belongs to no transfer
  std::uint32_t malformed = 0;
};

struct IsotpArrival {
  bool datagram;     // data() and size() are valid until the next on_frame()
  IsotpError error;  // the first error; a datagram can complete in the same call (interrupted)
};

class IsotpReceiver {
 public:
  // `buffer` has `capacity` bytes: max_datagram for R4 datagrams.
  IsotpReceiver(const IsotpReceiverOptions& options, void* buffer, std::uint32_t capacity);

  // Ignores frames with another id, and flow control. Constant time.
  IsotpArrival on_frame(const CanFrame& frame, std::uint32_t now_us);
  bool offer(std::uint32_t now_us, CanFrame& frame);
  void frame_sent(std::uint32_t now_us);
  IsotpError poll(std::uint32_t now_us) {
    return state_ == State::idle || !reached(now_us, deadline_us_) ? IsotpError::none : time_out();
  }
  // While held, answers with `wait` instead of `clear_to_send`. After max_waits such answers the
  // transfer ends (9.7). If the sender already has `clear_to_send`, hold() does not stop it.
  void hold(bool held, std::uint32_t now_us);
  void cancel();

  bool busy() const { return state_ != State::idle && !refusing(); }
  bool awaits_consecutive() const { return state_ == State::receiving; }
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
  std::uint32_t deadline_us_ = 0;  // owing: earliest offer; otherwise: end of the wait
  std::uint8_t rx_dl_ = 0;         // size of the first frame (9.5.4)
  std::uint8_t sequence_ = 0;
  std::uint8_t block_left_ = 0;  // frames until flow control is owed; 0: unlimited
  std::uint16_t waits_ = 0;
  bool held_ = false;
  State state_ = State::idle;
  IsotpFlowStatus status_ = IsotpFlowStatus::clear_to_send;  // status of the owed flow control
  IsotpReceiverCounters counters_;
};

}  // namespace r4
