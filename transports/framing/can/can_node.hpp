// SPDX-License-Identifier: GPL-3.0-or-later
// What is said between a board and its hosts on a CAN bus (docs/can.md), from either end: whole
// datagrams on one side, frames on the other.
//
//     dialogue    host to board, and the board's answers (N, I) back: ISO-TP with flow control
//     telemetry   the board's states and heartbeats: ISO-TP without, for any number of listeners
//
// Three raw frames stand beside them: the emergency stop, which a board's end takes for E:STOP; the
// reason, which it sends when a heartbeat first tells that the board went safe; and the request for
// states of who watches. Datagrams are taken plain and packed, and sent packed where that is wanted; a
// board answers a host that writes plain text in plain text.
//
// Driven like the ISO-TP ends that it is made of (isotp.hpp). Sans-I/O, no heap, about 4.5 KB. Which
// datagram goes next is up to a queue before it. Not for several threads.
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
  std::uint32_t stops = 0;     // emergency frames heard
  std::uint32_t unpacked = 0;  // packed datagrams taken
  std::uint32_t bad_form = 0;  // packed datagrams that do not unpack, dropped
};

// How a third party hears a lane of `node` (command, reply or telemetry) without taking part.
IsotpReceiverOptions listening_to(CanIdKind lane, std::uint8_t node);

// It has more than 15 members: two machines for each direction, each with its buffer.
class CanNode {
 public:
  // `node` is 0-31. With `fd`, frames of up to 64 bytes are sent; received are both.
  CanNode(CanEnd end, std::uint8_t node, bool fd);

  // At a host: sends the frame that asks for the board's states (docs/can.md, "Who watches").
  void ask_for_states() { request_due_ = true; }

  // Sends packed from the next datagram on; a board, unless the newest one of its host was plain.
  void use_packed_form(bool wanted) { packed_ = wanted; }

  // --- datagrams to send

  // Where a datagram goes: a host's to the dialogue, a board's by its kind.
  CanLane lane_of(Text datagram) const;
  // May begin() be called on that lane?
  bool idle(CanLane lane) const;
  // Takes a datagram of at most max_datagram bytes; it is copied. False, and nothing happens: its
  // lane is not idle, or it is empty or too long.
  bool begin(Text datagram, std::uint32_t now_us);

  // --- frames

  // Writes the frame to send now, the most urgent first; the same one until frame_sent(), unless
  // something more urgent came. False: none.
  bool offer(std::uint32_t now_us, CanFrame& frame);
  // Of those, only what stands alone and may overtake all that was accepted before: flow control,
  // for which the other end waits, and the reason of going safe.
  bool offer_urgent(std::uint32_t now_us, CanFrame& frame);
  // The frame that was offered last was accepted.
  void frame_sent(std::uint32_t now_us);
  // Is that frame part of a datagram of this end's dialogue, which the other end answers with flow
  // control?
  bool may_be_answered(const CanFrame& frame) const;
  // Such frames that were accepted still wait for the bus, or have only now got there: what answers
  // them may come later.
  void wait_anew(std::uint32_t now_us) { dialogue_out_.wait_anew(now_us); }
  // Takes a frame; one that is none of its own is passed over. Returns the datagram that it
  // completes, valid up to the next call, or an empty text.
  Text on_frame(const CanFrame& frame, std::uint32_t now_us);
  // Is the next frame of a transfer the other end's, which may come at once?
  bool awaits_frame() const {
    return telemetry_in_.awaits_consecutive() || dialogue_in_.awaits_consecutive() ||
           dialogue_out_.awaits_flow_control();
  }
  // Ends what has timed out.
  void poll(std::uint32_t now_us);
  IsotpDeadline deadline() const;
  // Ends the transfer to the other end that is under way: another host has begun one.
  void stop_commanding() { dialogue_out_.cancel(); }
  // Ends all transfers: the bus is gone.
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
  SafeReason reason_ = SafeReason::none;  // of the newest heartbeat
  bool reason_due_ = false;
  bool request_due_ = false;
  CanNodeCounters counters_;
};

}  // namespace r4
