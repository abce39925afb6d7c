// SPDX-License-Identifier: GPL-3.0-or-later
#include "bus_log.hpp"

#include <utility>

#include "bus_datagram.hpp"
#include "r4link/vocabulary.hpp"

namespace r4::tool {
namespace {

constexpr const char* record_it = "record with: candump -L INTERFACE";

Json time_json(const BusTransfers::LogPosition& position) {
  if (!position.date.empty()) return position.date;
  if (!position.time_us) return {};
  return static_cast<double>(*position.time_us) / 1e6;
}

const char* fix_of(CandumpError error) {
  switch (error) {
    case CandumpError::cut:
      return "remove the line: candump probably ended while it wrote the line";
    case CandumpError::dropped:
      return "use a larger buffer, candump -r 1000000, or record fewer ids";
    default:
      return record_it;
  }
}

const char* lane_name(CanIdKind kind) {
  switch (kind) {
    case CanIdKind::command:
      return "command";
    case CanIdKind::reply:
      return "reply";
    default:
      return "telemetry";
  }
}

Json beginning(const BusTransfers::Lane& lane, const BusTransfers::LogPosition& position) {
  const CanIdKind kind = lane.meaning.kind;
  return {{"line", position.line},
          {"time", time_json(position)},
          {"interface", lane.interface},
          {"node", lane.meaning.node},
          {"from", kind == CanIdKind::command ? "host" : "board"},
          {"lane", lane_name(kind)},
          {"frames", lane.frames}};
}

}  // namespace

void BusLog::on_line(std::uint64_t number, std::string_view text) {
  CandumpLine line;
  const CandumpError error = read_candump_line(text, line);
  if (error == CandumpError::detail) return;
  if (error != CandumpError::none) {
    return report_damage(number, to_text(error), fix_of(error), {{"text", escaped(text)}});
  }
  transfers_.pass_time(line.time_us);
  on_frame(line, {number, 0, line.time_us, std::string(line.date ? line.time : "")});
}

void BusLog::on_long_line(std::uint64_t number, std::uint64_t size) {
  report_damage(number, "the line is too long for a line of candump", record_it, {{"size", size}});
}

void BusLog::report_damage(std::uint64_t number, const char* reason, const char* fix, Json rest) {
  ++damaged_;
  Json object{
      {"line", number}, {"ok", false}, {"error", "candump"}, {"reason", reason}, {"fix", fix}};
  object.update(rest);
  print_(object);
}

void BusLog::on_frame(const CandumpLine& line, const BusTransfers::LogPosition& position) {
  ++frames_;
  if (line.error_frame) {
    ++error_frames_;
    return;
  }
  switch (transfers_.on_frame(line.interface, line.frame, position)) {
    case BusTransfers::Frame::taken:
      break;
    case BusTransfers::Frame::other:
      ++other_;
      break;
    case BusTransfers::Frame::too_many_interfaces:
      report_damage(position.line, "more than 32 interfaces in one dump",
                    "select the lines of one interface: grep ' can0 '",
                    {{"interface", std::string(line.interface)}});
  }
}

void BusLog::on_raw_frame(const std::string& interface, const CanIdMeaning& meaning,
                          const CanFrame& frame, const BusTransfers::LogPosition& position) {
  ++raw_;
  Json object{{"line", position.line}, {"time", time_json(position)}, {"interface", interface}};
  if (meaning.kind == CanIdKind::emergency_stop) {
    object.update({{"from", "host"}, {"ok", true}, {"type", "emergency_stop"}});
    return print_(object);
  }
  if (meaning.kind == CanIdKind::watch) {
    object.update({{"node", meaning.node}, {"from", "host"}, {"ok", true}, {"type", "watch"}});
    return print_(object);
  }
  object.update({{"node", meaning.node}, {"from", "board"}, {"ok", frame.size != 0}});
  if (frame.size == 0) {
    ++failed_;
    object.update(
        {{"error", "went_safe"}, {"reason", "the byte with the reason is missing in the frame"}});
  } else {
    const SafeReason reason =
        frame.data[0] == 0 ? SafeReason::fault : to_safe_reason(frame.data[0]);
    object.update({{"type", "went_safe"},
                   {"reason", to_text(reason)},
                   {"fields", {{"SAFE", frame.data[0]}}}});
  }
  print_(object);
}

void BusLog::on_failure(const BusTransfers::Lane& lane, const BusTransfers::LogPosition& position,
                        IsotpError error) {
  ++failed_;
  const Text reason = to_text(error);
  Json object = beginning(lane, position);
  object.update({{"ok", false},
                 {"error", "isotp"},
                 {"reason", std::string_view(reason.data(), reason.size())}});
  print_(object);
}

void BusLog::on_datagram(const BusTransfers::Lane& lane) {
  ++datagrams_;
  Json object = beginning(lane, lane.last);
  if (lane.first.time_us && lane.last.time_us && *lane.last.time_us >= *lane.first.time_us) {
    object["took_ms"] = static_cast<double>(*lane.last.time_us - *lane.first.time_us) / 1e3;
  }
  if (!add_bus_json(object, lane.receiver.data(), lane.receiver.size())) ++bad_;
  print_(object);
}

void BusLog::finish() {
  print_({{"type", "summary"},
          {"frames", frames_},
          {"datagrams", datagrams_},
          {"bad", bad_},
          {"failed", failed_},
          {"raw", raw_},
          {"flow_control", transfers_.flow_control()},
          {"orphans", transfers_.orphans()},
          {"unfinished", transfers_.unfinished().size()},
          {"other", other_},
          {"error_frames", error_frames_},
          {"damaged_lines", damaged_}});
}

}  // namespace r4::tool
