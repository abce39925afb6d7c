// SPDX-License-Identifier: GPL-3.0-or-later
// The traffic of a board and its hosts on a CAN bus (docs/reference/can.md), at either end:
//     dialogue    host to board, and the board's answers (N, I): ISO-TP with flow control
//     telemetry   the board's states and heartbeats, for all listeners: ISO-TP without flow control
// Three raw frames are added: the emergency stop, which the board's end turns into E:STOP; the
// reason when a board goes safe; a watcher's request for states. Plain and packed datagrams are
// received. Driven like its ISO-TP ends (isotp.hpp). Sans-I/O, no heap, about 4.5 KB. The caller's
// queue chooses the next datagram. Not thread-safe.
#pragma once

#include <cstdint>

#include "isotp_receiver.hpp"
#include "isotp_sender.hpp"
#include "r4link/can/can_frame.hpp"
#include "r4link/can/can_ids.hpp"
#include "r4link/datagram.hpp"
#include "r4link/vocabulary.hpp"

namespace r4 {

enum class CanEnd : std::uint8_t { board, host };
enum class CanLane : std::uint8_t { dialogue, telemetry };

struct CanNodeCounters {
  std::uint32_t stops = 0;
  std::uint32_t unpacked = 0;
  std::uint32_t bad_form = 0;  // packed datagrams that do not unpack, dropped
};

// For a program that only listens to a lane of `node` (command, reply or telemetry).
IsotpReceiverOptions listening_to(CanIdKind lane, std::uint8_t node);

// More than 15 data members: two machines for each direction, each with its buffer.
class CanNode {
 public:
  // `node` is 0-31. With `fd`, sends frames of up to 64 bytes; both formats are received.
  CanNode(CanEnd end, std::uint8_t node, bool fd);

  // At a host: requests the board's states by a frame (docs/reference/can.md, "Watchers").
  void ask_for_states() { request_due_ = true; }

  // Sends packed datagrams; a board sends plain if its host's newest datagram was plain.
  void use_packed_form(bool wanted) { packed_ = wanted; }

  CanLane lane_of(Text datagram) const;
  bool idle(CanLane lane) const;
  // Copies a datagram. False without effect if the lane is busy, or the datagram empty or too long.
  bool begin(Text datagram, std::uint32_t now_us);

  // Writes the most urgent frame, until frame_sent() or a more urgent frame. False if none.
  bool offer(std::uint32_t now_us, CanFrame& frame);
  // Like offer(), but only frames that may overtake: flow control, and the reason for going safe.
  bool offer_urgent(std::uint32_t now_us, CanFrame& frame);
  void frame_sent(std::uint32_t now_us);
  // True for a frame of this end's dialogue, which the other end answers with flow control.
  bool may_be_answered(const CanFrame& frame) const;
  // Restarts the wait for flow control, because the frames still wait for the bus or have only now
  // reached it.
  void wait_anew(std::uint32_t now_us) { dialogue_out_.wait_anew(now_us); }
  // Returns the datagram that the frame completes, valid until the next call; otherwise empty.
  Text on_frame(const CanFrame& frame, std::uint32_t now_us);
  bool awaits_frame() const {
    return telemetry_in_.awaits_consecutive() || dialogue_in_.awaits_consecutive() ||
           dialogue_out_.awaits_flow_control();
  }
  void poll(std::uint32_t now_us);
  IsotpDeadline deadline() const;
  // Ends the transfer to the other end, because another host has begun a transfer.
  void stop_commanding() { dialogue_out_.cancel(); }
  void cancel();

  const CanNodeCounters& counters() const { return counters_; }
  const IsotpSenderCounters& sent(CanLane lane) const { return sender(lane).counters(); }
  const IsotpReceiverCounters& received(CanLane lane) const {
    return lane == CanLane::dialogue ? dialogue_in_.counters() : telemetry_in_.counters();
  }

 private:
  enum class Offered : std::uint8_t {
    nothing,
    flow_control,
    reason,
    dialogue,
    telemetry,
    request,
  };

  const IsotpSender& sender(CanLane lane) const {
    return lane == CanLane::dialogue ? dialogue_out_ : telemetry_out_;
  }
  IsotpSender& sender(CanLane lane) {
    return lane == CanLane::dialogue ? dialogue_out_ : telemetry_out_;
  }
  void note_reason(Text heartbeat);
  Text plain(const IsotpReceiver& receiver);

  const CanEnd end_;
  const std::uint8_t node_;
  bool packed_ = false;
  bool host_is_plain_ = false;  // at a board

  std::uint8_t dialogue_out_bytes_[max_datagram];
  std::uint8_t dialogue_in_bytes_[max_datagram];
  std::uint8_t telemetry_bytes_[max_datagram];  // a board sends it, a host receives it
  char plain_[max_datagram];
  IsotpSender dialogue_out_;
  IsotpSender telemetry_out_;
  IsotpReceiver dialogue_in_;
  IsotpReceiver telemetry_in_;

  Offered offered_ = Offered::nothing;
  SafeReason reason_ = SafeReason::link;  // of the newest heartbeat; a board starts without a host
  bool reason_due_ = false;
  bool request_due_ = false;
  CanNodeCounters counters_;
};

}  // namespace r4
