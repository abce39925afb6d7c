// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/can/can_survey.hpp"

#include <utility>

#include "../../protocol/messages/message.hpp"
#include "overheard_lane.hpp"

namespace r4 {

struct CanSurvey::Lanes {
  explicit Lanes(std::uint8_t node)
      : telemetry(CanIdKind::telemetry, node),
        replies(CanIdKind::reply, node),
        commands(CanIdKind::command, node) {}

  OverheardLane telemetry, replies, commands;
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
    case CanIdKind::command:
      return receive(meaning.node, frame, meaning.kind, at_us);
    case CanIdKind::went_safe:
      if (frame.size != 0) boards_[meaning.node].reason = to_safe_reason(frame.data[0]);
      return;
    case CanIdKind::emergency_stop:
      if (stop_callback_) stop_callback_();
      return;
    case CanIdKind::watch:
    case CanIdKind::other:
      return;
  }
}

bool CanSurvey::is_r4(std::uint32_t id) const {
  const CanIdMeaning meaning = classify(id);
  if (meaning.kind == CanIdKind::command) return board(meaning.node).commands != 0;
  return meaning.kind == CanIdKind::emergency_stop ||
         (meaning.kind != CanIdKind::other && board(meaning.node).sends_datagrams());
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
  if (!lanes_[node]) lanes_[node] = std::make_unique<Lanes>(node);
  Lanes& own = *lanes_[node];
  OverheardLane& lane = kind == CanIdKind::command ? own.commands
                        : kind == CanIdKind::reply ? own.replies
                                                   : own.telemetry;
  const std::uint64_t before = errors(lane.counters());
  const std::optional<Text> bytes = lane.on_frame(frame, at_us);
  if (kind == CanIdKind::command) {
    Datagram datagram;
    if (bytes && read_datagram(*bytes, datagram)) ++boards_[node].commands;
    return;
  }
  boards_[node].damaged += errors(lane.counters()) - before;
  if (bytes) take(node, *bytes, at_us);
}

void CanSurvey::take(std::uint8_t node, Text bytes, std::uint32_t at_us) {
  HeardNode& board = boards_[node];
  Datagram datagram;
  if (!read_datagram(bytes, datagram) || !datagram.has_pnum() || !datagram.has_time()) {
    ++board.damaged;
    return;
  }
  board.heard_us = at_us;
  // Answers to hosts that do not control the board have separate packet numbers.
  bool is_answer = false;
  switch (kind_of(datagram)) {
    case MessageKind::state:
      ++board.states;
      // For a watcher, a board without a host streams states, but does not number its heartbeats.
      if (board.heartbeats == 0) board.connected = true;
      break;
    case MessageKind::board_heartbeat:
      ++board.heartbeats;
      board.reason = heartbeat_reason(datagram);
      board.connected = !is_connecting_heartbeat(datagram);
      break;
    case MessageKind::nack:
    case MessageKind::identity:
      ++board.answers;
      is_answer = true;
      break;
    case MessageKind::host_heartbeat:
    case MessageKind::command:
      ++board.damaged;  // a host sent on a board's id
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
