// SPDX-License-Identifier: GPL-3.0-or-later
#include "can_survey.hpp"

#include <utility>

#include "../../protocol/messages/message.hpp"
#include "../framing/can/can_node.hpp"
#include "../framing/can/isotp_receiver.hpp"
#include "../framing/can/packed_form.hpp"
#include "overheard_commands.hpp"

namespace r4 {

// What a board sends, heard by receivers that never answer.
struct CanSurvey::Lanes {
  explicit Lanes(std::uint8_t node)
      : telemetry(listening_to(CanIdKind::telemetry, node), telemetry_bytes.data(), max_datagram),
        replies(listening_to(CanIdKind::reply, node), reply_bytes.data(), max_datagram),
        commands(node) {}

  std::array<std::uint8_t, max_datagram> telemetry_bytes, reply_bytes;
  IsotpReceiver telemetry, replies;
  OverheardCommands commands;
  PacketTracker packets;
};

namespace {

std::uint64_t errors(const IsotpReceiverCounters& c) {
  return std::uint64_t{c.wrong_sequence_number} + c.overflow + c.malformed + c.interrupted +
         c.consecutive_timeout;
}

}  // namespace

CanSurvey::CanSurvey(CanBitRate rate) : rate_(rate) {}
CanSurvey::~CanSurvey() = default;

void CanSurvey::on_datagram(std::function<void(std::uint8_t, const Datagram&)> callback) {
  datagram_callback_ = std::move(callback);
}
void CanSurvey::on_stop(std::function<void()> callback) { stop_callback_ = std::move(callback); }

void CanSurvey::on_frame(const CanFrame& frame, std::uint32_t at_us) {
  count(frame);
  const CanIdMeaning meaning = classify(frame);
  switch (meaning.kind) {
    case CanIdKind::telemetry:
    case CanIdKind::reply:
      return receive(meaning.node, frame, meaning.kind, at_us);
    case CanIdKind::went_safe:
      if (frame.size != 0) boards_[meaning.node].reason = to_safe_reason(frame.data[0]);
      return;
    case CanIdKind::emergency_stop:
      if (stop_callback_) stop_callback_();
      return;
    case CanIdKind::command:
      return receive_command(meaning.node, frame, at_us);
    case CanIdKind::watch:
    case CanIdKind::other:
      return;
  }
}

bool CanSurvey::is_r4(std::uint32_t id) const {
  const CanIdMeaning meaning = classify(id);
  switch (meaning.kind) {
    case CanIdKind::emergency_stop:
      return true;
    case CanIdKind::command:
      return board(meaning.node).commands != 0;
    case CanIdKind::went_safe:
    case CanIdKind::reply:
    case CanIdKind::telemetry:
    case CanIdKind::watch:
      return board(meaning.node).sends_datagrams();
    case CanIdKind::other:
      break;
  }
  return false;
}

CanSurvey::Lanes& CanSurvey::lanes(std::uint8_t node) {
  std::unique_ptr<Lanes>& lanes = lanes_[node];
  if (!lanes) lanes = std::make_unique<Lanes>(node);
  return *lanes;
}

void CanSurvey::receive_command(std::uint8_t node, const CanFrame& frame, std::uint32_t at_us) {
  const std::string_view bytes = lanes(node).commands.on_frame(frame, at_us);
  Datagram datagram;
  if (read_datagram(Text(bytes.data(), bytes.size()), datagram)) ++boards_[node].commands;
}

void CanSurvey::count(const CanFrame& frame) {
  const CanBits bits = can_bits(frame, rate_.data != 0);
  CanTraffic& traffic = traffic_[frame.extended ? extended_ids : frame.id];
  ++traffic.frames;
  traffic.bits += total(bits);
  const std::uint64_t busy_ns = time_ns(bits, rate_);
  traffic.busy_ns += busy_ns;
  busy_ns_ += busy_ns;
}

void CanSurvey::receive(std::uint8_t node, const CanFrame& frame, CanIdKind kind,
                        std::uint32_t at_us) {
  Lanes& own = lanes(node);
  IsotpReceiver& receiver = kind == CanIdKind::reply ? own.replies : own.telemetry;
  const std::uint64_t before = errors(receiver.counters());
  const bool complete = receiver.on_frame(frame, at_us).datagram;
  boards_[node].damaged += errors(receiver.counters()) - before;
  if (!complete) return;
  const std::uint8_t* const bytes = receiver.data();
  if (!is_packed(bytes[0])) return take(node, receiver.text(), at_us);
  std::array<char, max_datagram> plain;
  const UnpackResult result = unpack(bytes, receiver.size(), plain.data(), plain.size());
  take(node, result ? Text(plain.data(), result.size) : Text(), at_us);
}

void CanSurvey::take(std::uint8_t node, Text bytes, std::uint32_t at_us) {
  HeardBoard& board = boards_[node];
  Datagram datagram;
  if (!read_datagram(bytes, datagram) || !datagram.has_pnum() || !datagram.has_time()) {
    ++board.damaged;
    return;
  }
  board.heard_us = at_us;
  // Answers to hosts that do not control the board have numbers of their own.
  bool is_answer = false;
  switch (kind_of(datagram)) {
    case MessageKind::state:
      ++board.states;
      // Who watches has a board stream that has no host: its heartbeats tell.
      if (board.heartbeats == 0) board.connected = true;
      break;
    case MessageKind::board_heartbeat:
      ++board.heartbeats;
      board.reason = heartbeat_reason(datagram);
      // Without a host they are all the same (docs/protocol.md).
      board.connected = datagram.pnum() != 0 || datagram.time_ms() != 0;
      break;
    case MessageKind::nack:
    case MessageKind::identity:
      ++board.answers;
      is_answer = true;
      break;
    case MessageKind::host_heartbeat:
    case MessageKind::command:
      ++board.damaged;  // a host on a board's id
      return;
  }
  PacketTracker& packets = lanes_[node]->packets;
  if (!board.connected) {
    packets.restart();
  } else if (!is_answer || datagram.pnum() - packets.newest() <= PacketTracker::window) {
    packets.on(datagram.pnum());
  }
  board.lost = packets.counters().lost;
  board.pnum = datagram.pnum();
  board.t_ms = datagram.time_ms();
  if (datagram_callback_) datagram_callback_(node, datagram);
}

}  // namespace r4
