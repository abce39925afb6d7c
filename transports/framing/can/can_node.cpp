// SPDX-License-Identifier: GPL-3.0-or-later
#include "can_node.hpp"

#include <cstring>

#include "../../../protocol/messages/command_field.hpp"
#include "../../../protocol/messages/message.hpp"
#include "r4link/command.hpp"
#include "r4link/messages/datagram_writer.hpp"
#include "r4link/messages/packed_form.hpp"

namespace r4 {
namespace {

constexpr Text stop_datagram("E:STOP;^0x506f0fbe^");
// The meaning of a watch frame: 5 Hz. Even a slow bus carries the states as text, 24 frames each.
constexpr Text watch_datagram("W:5;^0x414648b3^");

IsotpSenderOptions sender_options(std::uint32_t id, std::uint32_t flow_control_id, bool fd) {
  IsotpSenderOptions options;
  options.channel.id = id;
  options.channel.flow_control_id = flow_control_id;
  options.channel.fd = fd;
  options.tx_dl = fd ? max_fd_size : max_classic_size;
  return options;
}

IsotpReceiverOptions receiver_options(std::uint32_t id, std::uint32_t flow_control_id, bool fd) {
  IsotpReceiverOptions options;
  options.channel.id = id;
  options.channel.flow_control_id = flow_control_id;
  options.channel.fd = fd;
  return options;
}

IsotpSenderOptions telemetry_sender(std::uint8_t node, bool fd) {
  IsotpSenderOptions options = sender_options(telemetry_id(node), max_can_id, fd);
  options.flow_control = false;
  return options;
}

IsotpReceiverOptions telemetry_receiver(std::uint8_t node, bool fd) {
  IsotpReceiverOptions options = receiver_options(telemetry_id(node), max_can_id, fd);
  options.listen_only = true;
  return options;
}

constexpr std::uint32_t own_id(CanEnd end, std::uint8_t node) {
  return end == CanEnd::board ? reply_id(node) : command_id(node);
}
constexpr std::uint32_t other_id(CanEnd end, std::uint8_t node) {
  return end == CanEnd::board ? command_id(node) : reply_id(node);
}

}  // namespace

IsotpReceiverOptions listening_to(CanIdKind lane, std::uint8_t node) {
  IsotpReceiverOptions options;
  options.listen_only = true;
  if (lane == CanIdKind::telemetry) {
    options.channel.id = telemetry_id(node);
  } else {
    options.channel.id = lane == CanIdKind::command ? command_id(node) : reply_id(node);
    // After its first frame the sender waits for flow control, which this end does not see.
    options.n_cr_us += IsotpSenderOptions().n_bs_us;
  }
  return options;
}

CanNode::CanNode(CanEnd end, std::uint8_t node, bool fd)
    : end_(end),
      node_(static_cast<std::uint8_t>(node % can_nodes)),
      dialogue_out_(sender_options(own_id(end, node), other_id(end, node), fd)),
      telemetry_out_(telemetry_sender(node, fd)),
      dialogue_in_(receiver_options(other_id(end, node), own_id(end, node), fd), dialogue_in_bytes_,
                   sizeof dialogue_in_bytes_),
      telemetry_in_(telemetry_receiver(node, fd), telemetry_bytes_, sizeof telemetry_bytes_) {}

bool CanNode::may_be_answered(const CanFrame& frame) const {
  return frame.id == own_id(end_, node_) && !isotp_frame::is_flow_control(frame);
}

CanLane CanNode::lane_of(Text datagram) const {
  if (end_ == CanEnd::host) return CanLane::dialogue;
  const bool answer = datagram.size() > 1 && datagram.data()[1] == ':' &&
                      (datagram.data()[0] == 'N' || datagram.data()[0] == 'I');
  return answer ? CanLane::dialogue : CanLane::telemetry;
}

bool CanNode::idle(CanLane lane) const { return !sender(lane).busy(); }

bool CanNode::begin(Text datagram, std::uint32_t now_us) {
  const CanLane lane = lane_of(datagram);
  if (!idle(lane) || datagram.empty() || datagram.size() > max_datagram) return false;
  std::uint8_t* const bytes = lane == CanLane::dialogue ? dialogue_out_bytes_ : telemetry_bytes_;
  std::size_t size = packed_ && !host_is_plain_ ? pack(datagram, bytes, max_datagram) : 0;
  if (size == 0) {
    size = datagram.size();
    std::memcpy(bytes, datagram.data(), size);
  }
  if (end_ == CanEnd::board && datagram.data()[0] == 'H') note_reason(datagram);
  return sender(lane).begin(bytes, static_cast<std::uint32_t>(size), now_us);
}

void CanNode::note_reason(Text heartbeat) {
  Datagram datagram;
  if (!read_datagram(heartbeat, datagram)) return;
  SafeReason reason = heartbeat_reason(datagram);
  // The heartbeat of CONNECTING leaves out this reason.
  if (reason == SafeReason::none && is_connecting_heartbeat(datagram)) reason = SafeReason::link;
  if (reason == reason_) return;  // reported, or due to be reported
  reason_due_ = reason != SafeReason::none;
  reason_ = reason;
}

bool CanNode::offer(std::uint32_t now_us, CanFrame& frame) {
  if (offer_urgent(now_us, frame)) return true;
  if (dialogue_out_.offer(now_us, frame)) {
    offered_ = Offered::dialogue;
  } else if (telemetry_out_.offer(now_us, frame)) {
    offered_ = Offered::telemetry;
  } else if (request_due_) {
    frame = CanFrame{};
    frame.id = watch_id(node_);
    offered_ = Offered::request;
  }
  return offered_ != Offered::nothing;
}

bool CanNode::offer_urgent(std::uint32_t now_us, CanFrame& frame) {
  offered_ = Offered::nothing;
  if (dialogue_in_.offer(now_us, frame)) {
    offered_ = Offered::flow_control;
  } else if (reason_due_) {
    frame = CanFrame{};
    frame.id = went_safe_id(node_);
    frame.size = 1;
    frame.data[0] = static_cast<std::uint8_t>(reason_);
    offered_ = Offered::reason;
  }
  return offered_ != Offered::nothing;
}

void CanNode::frame_sent(std::uint32_t now_us) {
  switch (offered_) {
    case Offered::nothing:
      break;
    case Offered::flow_control:
      dialogue_in_.frame_sent(now_us);
      break;
    case Offered::reason:
      reason_due_ = false;
      break;
    case Offered::dialogue:
      dialogue_out_.frame_sent(now_us);
      break;
    case Offered::telemetry:
      telemetry_out_.frame_sent(now_us);
      break;
    case Offered::request:
      request_due_ = false;
      break;
  }
  offered_ = Offered::nothing;
}

Text CanNode::on_frame(const CanFrame& frame, std::uint32_t now_us) {
  const CanIdMeaning meaning = classify(frame);
  if (meaning.kind == CanIdKind::emergency_stop) {
    if (end_ != CanEnd::board) return Text();
    ++counters_.stops;
    if (!frame.extended) return stop_datagram;
    DatagramWriter writer(plain_, sizeof plain_);
    writer.field("E").value(Text("STOP"));
    writer.field(stop_number_name).value(short_stop_number(frame.id));
    return writer.finish();
  }
  if (meaning.kind == CanIdKind::watch) {
    return end_ == CanEnd::board && meaning.node == node_ ? watch_datagram : Text();
  }
  if (end_ == CanEnd::host && meaning.kind == CanIdKind::telemetry) {
    return telemetry_in_.on_frame(frame, now_us).datagram ? plain(telemetry_in_) : Text();
  }
  // The dialogue's directions share the two ids. Each machine ignores the other direction's frames.
  dialogue_out_.on_frame(frame, now_us);
  if (!dialogue_in_.on_frame(frame, now_us).datagram) return Text();
  const Text datagram = plain(dialogue_in_);
  // An empty datagram does not show the form that the host uses.
  if (end_ == CanEnd::board && datagram.size() != 0) {
    host_is_plain_ = !is_packed(dialogue_in_.data()[0]);
  }
  return datagram;
}

Text CanNode::plain(const IsotpReceiver& receiver) {
  if (receiver.size() == 0 || !is_packed(receiver.data()[0])) return receiver.text();
  const UnpackResult result = unpack(receiver.data(), receiver.size(), plain_, sizeof plain_);
  if (!result) {
    ++counters_.bad_form;
    return Text();
  }
  ++counters_.unpacked;
  return Text(plain_, result.size);
}

void CanNode::poll(std::uint32_t now_us) {
  dialogue_in_.poll(now_us);
  telemetry_in_.poll(now_us);
  dialogue_out_.poll(now_us);
  telemetry_out_.poll(now_us);
}

IsotpDeadline CanNode::deadline() const {
  IsotpDeadline first = dialogue_in_.deadline();
  const IsotpDeadline others[] = {telemetry_in_.deadline(), dialogue_out_.deadline(),
                                  telemetry_out_.deadline()};
  for (const IsotpDeadline& next : others) {
    if (next.armed && (!first.armed || !reached(next.at_us, first.at_us))) first = next;
  }
  return first;
}

void CanNode::cancel() {
  dialogue_in_.cancel();
  telemetry_in_.cancel();
  dialogue_out_.cancel();
  telemetry_out_.cancel();
  request_due_ = false;
  offered_ = Offered::nothing;
}

}  // namespace r4
