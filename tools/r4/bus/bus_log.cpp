// SPDX-License-Identifier: GPL-3.0-or-later
#include "bus_log.hpp"

#include <algorithm>
#include <utility>

#include "r4link/vocabulary.hpp"
#include "transports/framing/can/can_node.hpp"
#include "transports/framing/can/packed_form.hpp"

namespace r4::tool {
namespace {

// A longer pause is as good as this: nothing is under way after it.
constexpr std::uint64_t longest_pause_us = 10'000'000;

constexpr const char* record_it = "record with: candump -L INTERFACE";

Json time_json(const CandumpLine& line) {
  if (line.date) return line.time;
  if (!line.time_us) return {};
  return static_cast<double>(*line.time_us) / 1e6;
}

const char* fix_of(CandumpError error) {
  switch (error) {
    case CandumpError::cut:
      return "was candump killed while it wrote? Leave the line out";
    case CandumpError::dropped:
      return "give it a larger buffer, candump -r 1000000, or fewer ids to record";
    default:
      return record_it;
  }
}

struct LaneKind {
  std::size_t index;
  const char* from;
  const char* name;
};

constexpr LaneKind lane_kind(CanIdKind kind) {
  switch (kind) {
    case CanIdKind::command:
      return {0, "host", "command"};
    case CanIdKind::reply:
      return {1, "board", "reply"};
    default:
      return {2, "board", "telemetry"};
  }
}

}  // namespace

BusLog::Lane::Lane(const CanIdMeaning& meaning)
    : receiver(listening_to(meaning.kind, meaning.node), bytes.data(), max_datagram) {}

void BusLog::on_line(std::uint64_t number, std::string_view text) {
  CandumpLine line;
  const CandumpError error = read_candump_line(text, line);
  if (error == CandumpError::detail) return;
  if (error != CandumpError::none) {
    return report_damage(number, to_text(error), fix_of(error), {{"text", escaped(text)}});
  }
  pass_time(line.time_us);
  on_frame(line, {number, time_json(line), line.time_us});
}

void BusLog::on_long_line(std::uint64_t number, std::uint64_t size) {
  report_damage(number, "longer than a line of candump can be", record_it, {{"size", size}});
}

void BusLog::report_damage(std::uint64_t number, const char* reason, const char* fix, Json rest) {
  ++damaged_;
  Json object{
      {"line", number}, {"ok", false}, {"error", "candump"}, {"reason", reason}, {"fix", fix}};
  object.update(rest);
  print_(object);
}

void BusLog::on_frame(const CandumpLine& line, const Place& place) {
  ++frames_;
  if (line.error_frame) {
    ++error_frames_;
    return;
  }
  const CanIdMeaning meaning = classify(line.frame);
  if (meaning.kind == CanIdKind::other) {
    ++other_;
    return;
  }
  Interface* const interface = interface_of(line.interface);
  if (interface == nullptr) {
    return report_damage(place.line, "more than 32 interfaces in one dump",
                         "leave lines out: grep ' can0 '",
                         {{"interface", std::string(line.interface)}});
  }
  if (meaning.kind == CanIdKind::emergency_stop || meaning.kind == CanIdKind::went_safe) {
    on_raw_frame(*interface, meaning, line.frame, place);
  } else {
    on_lane_frame(*interface, meaning, line.frame, place);
  }
}

void BusLog::on_raw_frame(const Interface& interface, const CanIdMeaning& meaning,
                          const CanFrame& frame, const Place& place) {
  ++raw_;
  Json object{{"line", place.line}, {"time", place.time}, {"interface", interface.name}};
  if (meaning.kind == CanIdKind::emergency_stop) {
    object.update({{"from", "host"}, {"ok", true}, {"type", "emergency_stop"}});
    return print_(object);
  }
  object.update({{"node", meaning.node}, {"from", "board"}, {"ok", frame.size != 0}});
  if (frame.size == 0) {
    ++failed_;
    object.update({{"error", "went_safe"}, {"reason", "the frame has no byte with the reason"}});
  } else {
    const SafeReason reason =
        frame.data[0] == 0 ? SafeReason::fault : to_safe_reason(frame.data[0]);
    object.update({{"type", "went_safe"},
                   {"reason", to_text(reason)},
                   {"fields", {{"SAFE", frame.data[0]}}}});
  }
  print_(object);
}

void BusLog::on_lane_frame(Interface& interface, const CanIdMeaning& meaning, const CanFrame& frame,
                           const Place& place) {
  if (isotp_frame::is_flow_control(frame) && meaning.kind != CanIdKind::telemetry) {
    ++flow_control_;
    // Each end has its flow control on the id of its own datagrams.
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
    report_failure(lane, lane.last, IsotpError::interrupted);
  }
  if (after.started != before.started) {
    lane.frames = 0;
    lane.answered = false;
    lane.first = place;
  }
  if (after.started + after.consecutive != before.started + before.consecutive) {
    ++lane.frames;
    lane.last = place;
  } else if (after.wrong_sequence_number != before.wrong_sequence_number) {
    report_failure(lane, place, IsotpError::wrong_sequence_number);
  } else if (after.overflow != before.overflow) {
    lane.frames = 1;
    report_failure(lane, place, IsotpError::overflow);
  } else if (after.malformed != before.malformed) {
    lane.frames = 1;
    report_failure(lane, place, IsotpError::malformed);
  } else {
    ++orphans_;  // of no transfer, or flow control where there is none
  }
  if (arrival.datagram) report_datagram(lane);

  const IsotpDeadline deadline = lane.receiver.deadline();
  if (deadline.armed && (!earliest_.armed || !reached(deadline.at_us, earliest_.at_us))) {
    earliest_ = deadline;
  }
}

void BusLog::pass_time(const std::optional<std::uint64_t>& time_us) {
  if (!time_us) return;
  if (last_time_us_ && *time_us > *last_time_us_) {
    now_us_ += static_cast<std::uint32_t>(std::min(*time_us - *last_time_us_, longest_pause_us));
  }
  last_time_us_ = time_us;
  if (earliest_.armed && reached(now_us_, earliest_.at_us)) end_late_transfers();
}

void BusLog::end_late_transfers() {
  earliest_.armed = false;
  for (Lane* const lane : lanes_) {
    IsotpError error = lane->receiver.poll(now_us_);
    if (error != IsotpError::none) {
      const bool dialogue = lane->whose["lane"] != "telemetry";
      if (dialogue && lane->frames == 1 && !lane->answered) {
        error = IsotpError::flow_control_timeout;
      }
      report_failure(*lane, lane->last, error);
    }
    const IsotpDeadline deadline = lane->receiver.deadline();
    if (deadline.armed && (!earliest_.armed || !reached(deadline.at_us, earliest_.at_us))) {
      earliest_ = deadline;
    }
  }
}

void BusLog::report_failure(const Lane& lane, const Place& place, IsotpError error) {
  ++failed_;
  const Text reason = to_text(error);
  Json object{{"line", place.line}, {"time", place.time}};
  object.update(lane.whose);
  object.update({{"frames", lane.frames},
                 {"ok", false},
                 {"error", "isotp"},
                 {"reason", std::string_view(reason.data(), reason.size())}});
  print_(object);
}

void BusLog::report_datagram(const Lane& lane) {
  ++datagrams_;
  Json object{{"line", lane.last.line}, {"time", lane.last.time}};
  object.update(lane.whose);
  object["frames"] = lane.frames;
  if (lane.first.time_us && lane.last.time_us && *lane.last.time_us >= *lane.first.time_us) {
    object["took_ms"] = static_cast<double>(*lane.last.time_us - *lane.first.time_us) / 1e3;
  }
  if (!add_datagram_json(object, lane.receiver.data(), lane.receiver.size())) ++bad_;
  print_(object);
}

void BusLog::finish() {
  const auto unfinished = std::count_if(lanes_.begin(), lanes_.end(),
                                        [](const Lane* lane) { return lane->receiver.busy(); });
  print_({{"type", "summary"},
          {"frames", frames_},
          {"datagrams", datagrams_},
          {"bad", bad_},
          {"failed", failed_},
          {"raw", raw_},
          {"flow_control", flow_control_},
          {"orphans", orphans_},
          {"unfinished", unfinished},
          {"other", other_},
          {"error_frames", error_frames_},
          {"damaged_lines", damaged_}});
}

BusLog::Interface* BusLog::interface_of(std::string_view name) {
  for (Interface& each : interfaces_) {
    if (each.name == name) return &each;
  }
  if (interfaces_.size() == max_interfaces) return nullptr;
  interfaces_.emplace_back().name = name;
  return &interfaces_.back();
}

BusLog::Lane& BusLog::lane_of(Interface& interface, const CanIdMeaning& meaning) {
  const LaneKind kind = lane_kind(meaning.kind);
  std::unique_ptr<Lane>& lane = interface.lanes[meaning.node][kind.index];
  if (!lane) {
    lane = std::make_unique<Lane>(meaning);
    lane->whose = {{"interface", interface.name},
                   {"node", meaning.node},
                   {"from", kind.from},
                   {"lane", kind.name}};
    lanes_.push_back(lane.get());
  }
  return *lane;
}

}  // namespace r4::tool
