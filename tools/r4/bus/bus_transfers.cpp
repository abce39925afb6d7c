// SPDX-License-Identifier: GPL-3.0-or-later
#include "bus_transfers.hpp"

#include <algorithm>
#include <utility>

#include "transports/framing/can/can_node.hpp"

namespace r4::tool {
namespace {

// A longer pause is shortened to this limit, by which every transfer has ended.
constexpr std::uint64_t longest_pause_us = 10'000'000;

constexpr std::size_t index_of(CanIdKind kind) {
  return kind == CanIdKind::command ? 0 : kind == CanIdKind::reply ? 1 : 2;
}

}  // namespace

BusTransfers::Lane::Lane(std::string name, const CanIdMeaning& what)
    : interface(std::move(name)),
      meaning(what),
      receiver(listening_to(what.kind, what.node), bytes.data(), max_datagram) {}

BusTransfers::Frame BusTransfers::on_frame(std::string_view interface, const CanFrame& frame,
                                           const LogPosition& position) {
  const CanIdMeaning meaning = classify(frame);
  if (meaning.kind == CanIdKind::other) return Frame::other;
  Interface* const known = interface_of(interface);
  if (known == nullptr) return Frame::too_many_interfaces;
  const bool raw = meaning.kind == CanIdKind::emergency_stop ||
                   meaning.kind == CanIdKind::went_safe || meaning.kind == CanIdKind::watch;
  if (raw) {
    handler_.on_raw_frame(known->name, meaning, frame, position);
  } else {
    on_lane_frame(*known, meaning, frame, position);
  }
  return Frame::taken;
}

void BusTransfers::on_lane_frame(Interface& interface, const CanIdMeaning& meaning,
                                 const CanFrame& frame, const LogPosition& position) {
  if (isotp_frame::is_flow_control(frame) && meaning.kind != CanIdKind::telemetry) {
    ++flow_control_;
    // A receiver sends flow control on the id of its own datagrams. So this frame answers a
    // transfer on the other lane.
    const bool of_board = meaning.kind == CanIdKind::reply;
    lane_of(interface, {of_board ? CanIdKind::command : CanIdKind::reply, meaning.node}).answered =
        true;
    return;
  }
  Lane& lane = lane_of(interface, meaning);
  const IsotpReceiverCounters before = lane.receiver.counters();
  const IsotpArrival arrival = lane.receiver.on_frame(frame, now_us_);
  const IsotpReceiverCounters& after = lane.receiver.counters();

  if (after.interrupted != before.interrupted) {
    handler_.on_failure(lane, lane.last, IsotpError::interrupted);
  }
  if (after.started != before.started) {
    lane.frames = 0;
    lane.answered = false;
    lane.first = position;
  }
  if (after.started + after.consecutive != before.started + before.consecutive) {
    ++lane.frames;
    lane.last = position;
  } else if (after.wrong_sequence_number != before.wrong_sequence_number) {
    handler_.on_failure(lane, position, IsotpError::wrong_sequence_number);
  } else if (after.overflow != before.overflow) {
    lane.frames = 1;
    handler_.on_failure(lane, position, IsotpError::overflow);
  } else if (after.malformed != before.malformed) {
    lane.frames = 1;
    handler_.on_failure(lane, position, IsotpError::malformed);
  } else {
    ++orphans_;  // a frame outside any transfer, or unexpected flow control
  }
  if (arrival.datagram) handler_.on_datagram(lane);

  const IsotpDeadline deadline = lane.receiver.deadline();
  if (deadline.armed && (!earliest_.armed || !reached(deadline.at_us, earliest_.at_us))) {
    earliest_ = deadline;
  }
}

void BusTransfers::pass_time(const std::optional<std::uint64_t>& time_us) {
  if (!time_us) return;
  if (last_time_us_ && *time_us > *last_time_us_) {
    now_us_ += static_cast<std::uint32_t>(std::min(*time_us - *last_time_us_, longest_pause_us));
  }
  last_time_us_ = time_us;
  if (earliest_.armed && reached(now_us_, earliest_.at_us)) end_late_transfers();
}

void BusTransfers::end_late_transfers() {
  earliest_.armed = false;
  for (Lane* const lane : lanes_) {
    IsotpError error = lane->receiver.poll(now_us_);
    if (error != IsotpError::none) {
      const bool dialogue = lane->meaning.kind != CanIdKind::telemetry;
      if (dialogue && lane->frames == 1 && !lane->answered) {
        error = IsotpError::flow_control_timeout;
      }
      handler_.on_failure(*lane, lane->last, error);
    }
    const IsotpDeadline deadline = lane->receiver.deadline();
    if (deadline.armed && (!earliest_.armed || !reached(deadline.at_us, earliest_.at_us))) {
      earliest_ = deadline;
    }
  }
}

BusTransfers::Interface* BusTransfers::interface_of(std::string_view name) {
  for (Interface& each : interfaces_) {
    if (each.name == name) return &each;
  }
  if (interfaces_.size() == max_interfaces) return nullptr;
  interfaces_.emplace_back().name = name;
  return &interfaces_.back();
}

BusTransfers::Lane& BusTransfers::lane_of(Interface& interface, const CanIdMeaning& meaning) {
  std::unique_ptr<Lane>& lane = interface.lanes[meaning.node][index_of(meaning.kind)];
  if (!lane) {
    lane = std::make_unique<Lane>(interface.name, meaning);
    lanes_.push_back(lane.get());
  }
  return *lane;
}

std::vector<const BusTransfers::Lane*> BusTransfers::unfinished() const {
  std::vector<const Lane*> lanes;
  for (const Lane* const lane : lanes_) {
    if (lane->receiver.busy()) lanes.push_back(lane);
  }
  return lanes;
}

}  // namespace r4::tool
