// SPDX-License-Identifier: GPL-3.0-or-later
#include "recording_summary.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "../shell/number.hpp"
#include "formats.hpp"
#include "r4link/messages/message.hpp"

namespace r4::tool {
namespace {

// A badly damaged file may appear to have more paths. Further paths are counted as one.
constexpr std::size_t most_paths = 1000;
// More devices than a board has slots, for recordings of many parts.
constexpr std::size_t most_devices = 64;

double seconds_of(Time time) { return std::chrono::duration<double>(time).count(); }

double rate_of(const PathSummary& path) {
  const double heard = seconds_of(path.last - path.first);
  return heard > 0 && path.states > 1 ? static_cast<double>(path.states - 1) / heard : 0;
}

std::string_view word_after(std::string_view text, std::string_view first) {
  if (!text.starts_with(first)) return {};
  return text.substr(first.size());
}

const char* place_of(RecordingDamage::Kind kind) {
  switch (kind) {
    case RecordingDamage::Kind::line:
      return "line";
    case RecordingDamage::Kind::torn:
      return "torn";
    case RecordingDamage::Kind::zstd:
      break;
  }
  return "zstd";
}

}  // namespace

void RecordingSummary::on_header() {
  numbers_.clear();
  if (!ended_) ++unended_;
  ended_ = false;
}

// Files of one program may share a path: the number and the URL identify it.
void RecordingSummary::on_path(const RecordedPath& path) {
  const auto known = std::find_if(paths_.begin(), paths_.end(), [&path](const PathSummary& each) {
    return each.recorded.number == path.number &&
           (each.recorded.url == path.url || each.recorded.url.empty());
  });
  const auto index = static_cast<std::size_t>(known - paths_.begin());
  numbers_[path.number] = known == paths_.end() ? add(path.number) : index;
  of(path.number).recorded = path;
}

void RecordingSummary::on_device(const RecordedDevice& device) {
  std::vector<std::string>& known = of(device.path).devices;
  if (known.size() == most_devices || std::count(known.begin(), known.end(), device.place) != 0)
    return;
  known.push_back(device.place);
}

PathSummary& RecordingSummary::of(std::uint16_t number) {
  const auto known = numbers_.find(number);
  if (known != numbers_.end()) return paths_[known->second];
  return paths_[numbers_[number] = add(number)];
}

std::size_t RecordingSummary::add(std::uint16_t number) {
  if (paths_.size() < most_paths) {
    paths_.emplace_back();
    paths_.back().recorded.number = number;
  }
  return paths_.size() - 1;
}

void RecordingSummary::on_record(const Record& record) {
  first_ = any_ ? std::min(first_, record.time) : record.time;
  last_ = any_ ? std::max(last_, record.time) : record.time;
  any_ = true;
  ++records_;
  if (record.kind == RecordKind::event) return on_event(record);
  PathSummary& path = of(record.path);
  if (record.kind == RecordKind::from_board) {
    on_received(path, record);
  } else {
    on_sent(path, record);
  }
}

void RecordingSummary::on_event(const Record& record) {
  if (record.path == no_path) {
    dropped_ += number_in<std::uint64_t>(word_after(record.bytes, "dropped ")).value_or(0);
    if (record.bytes == "end") ended_ = true;
  } else if (record.bytes.starts_with("down ")) {
    ++of(record.path).downs;
  } else if (record.bytes.starts_with("oversize ")) {
    ++of(record.path).oversize;
  }
}

void RecordingSummary::on_received(PathSummary& path, const Record& record) {
  const bool heard = path.received != 0;
  if (heard && record.time - path.last > shortest_gap) {
    ++path.gaps;
    if (record.time - path.last > path.longest_gap) {
      path.longest_gap = record.time - path.last;
      path.longest_gap_at = path.last;
    }
  }
  Datagram datagram;
  if (!read_datagram(Text(record.bytes), datagram)) {
    ++path.damaged;
    return;
  }
  if (!heard) path.first = record.time;
  path.last = record.time;
  ++path.received;
  const MessageKind kind = kind_of(datagram);
  if (kind == MessageKind::board_heartbeat && is_connecting_heartbeat(datagram)) {
    path.packets.restart();
  } else if (datagram.has_pnum()) {
    path.packets.on(datagram.pnum());
  }
  if (kind == MessageKind::state) ++path.states;
  if (kind != MessageKind::state && kind != MessageKind::board_heartbeat) return;
  be_safe(path, heartbeat_report(datagram).reason, record.time);
}

void RecordingSummary::be_safe(PathSummary& path, SafeReason reason, Time now) {
  if (path.safe != SafeReason::none) path.safe_for += std::max(Time{0}, now - path.safe_since);
  if (reason != path.safe && reason != SafeReason::none) {
    ++path.safe_times[static_cast<std::size_t>(reason)];
  }
  path.safe = reason;
  path.safe_since = now;
}

void RecordingSummary::on_sent(PathSummary& path, const Record& record) {
  ++path.sent;
  Datagram datagram;
  if (!read_datagram(Text(record.bytes), datagram)) return;
  if (kind_of(datagram) == MessageKind::host_heartbeat) ++path.heartbeats;
  const Field stop = datagram.find("E");
  if (!stop.name().empty() && stop.values() == Text("STOP")) ++path.stops;
}

void RecordingSummary::on_damage(const RecordingDamage& damage) {
  ++damage_count_;
  if (damage_.size() == most_damage) return;
  damage_.push_back(
      {place_of(damage.kind), damage.line, damage.offset, std::string(damage.reason)});
}

std::string RecordingSummary::text(const std::string& name) const {
  std::string out = printable(name) + "\n";
  const auto line = [&out](const char* what, const std::string& words) {
    out += fmt::format("  {:<10} {}\n", what, printable(words));
  };
  if (any_) {
    line("from", record_time_text(first_));
    line("to",
         fmt::format("{}, {:.1f} s later", record_time_text(last_), seconds_of(last_ - first_)));
  }
  for (const PathSummary& each : paths_) {
    line(fmt::format("path {}", each.recorded.number).c_str(),
         each.recorded.url + (each.recorded.name.empty() ? "" : "  " + each.recorded.name));
    line("", fmt::format(
                 "{} datagrams from the board: {} states, {:.1f} a second; {} damaged, {} lost{}",
                 each.received + each.damaged, each.states, rate_of(each), each.damaged,
                 each.packets.counters().lost,
                 each.oversize == 0 ? "" : fmt::format(", {} too long", each.oversize)));
    line("", fmt::format("{} datagrams to the board: {} heartbeats, {} stops", each.sent,
                         each.heartbeats, each.stops));
    if (!each.devices.empty()) line("", fmt::format("devices {}", fmt::join(each.devices, ", ")));
    std::string safe;
    for (std::size_t i = 1; i < each.safe_times.size(); ++i) {
      if (each.safe_times[i] == 0) continue;
      safe +=
          fmt::format(", {} ({} times)", to_text(static_cast<SafeReason>(i)), each.safe_times[i]);
    }
    if (!safe.empty())
      line("", fmt::format("safe for {:.1f} s{}", seconds_of(each.safe_for), safe));
    if (each.gaps != 0) {
      line("", fmt::format(
                   "silent for more than {} s {} times; the longest silence was {:.1f} s from {}",
                   shortest_gap / std::chrono::seconds{1}, each.gaps, seconds_of(each.longest_gap),
                   record_time_text(each.longest_gap_at)));
    }
    if (each.downs != 0) line("", fmt::format("the transport was lost {} times", each.downs));
  }
  if (dropped_ != 0) line("left out", fmt::format("{} records: the disk was too slow", dropped_));
  const std::uint64_t cut = unended_ + (ended_ ? 0 : 1);
  if (cut != 0) line("cut", "the end is missing: the recording program still runs, or was killed");
  for (const Damage& each : damage_) {
    const std::string place = each.line == 0 ? "" : fmt::format("line {}, ", each.line);
    line("damage", fmt::format("{}byte {}: {}", place, each.offset, each.reason));
  }
  if (damage_count_ > damage_.size()) {
    line("", fmt::format("and {} more", damage_count_ - damage_.size()));
  }
  return out;
}

Json RecordingSummary::json(const std::string& name) const {
  Json object{{"type", "recording"}, {"file", name}};
  object["from"] = any_ ? Json(record_time_text(first_)) : Json(nullptr);
  object["to"] = any_ ? Json(record_time_text(last_)) : Json(nullptr);
  object["seconds"] = seconds_of(last_ - first_);
  object["records"] = records_;
  object["dropped"] = dropped_;
  object["ended"] = ended_ && unended_ == 0;
  object["paths"] = Json::array();
  for (const PathSummary& each : paths_) {
    Json safe = Json::object();
    for (std::size_t i = 1; i < each.safe_times.size(); ++i) {
      if (each.safe_times[i] != 0) safe[to_text(static_cast<SafeReason>(i))] = each.safe_times[i];
    }
    object["paths"].push_back({{"path", each.recorded.number},
                               {"url", each.recorded.url},
                               {"name", each.recorded.name},
                               {"devices", each.devices},
                               {"received", each.received},
                               {"states", each.states},
                               {"states_hz", rate_of(each)},
                               {"damaged", each.damaged},
                               {"oversize", each.oversize},
                               {"lost", each.packets.counters().lost},
                               {"sent", each.sent},
                               {"heartbeats", each.heartbeats},
                               {"stops", each.stops},
                               {"safe", safe},
                               {"safe_s", seconds_of(each.safe_for)},
                               {"gaps", each.gaps},
                               {"longest_gap_s", seconds_of(each.longest_gap)},
                               {"downs", each.downs}});
  }
  object["damage_count"] = damage_count_;
  object["damage"] = Json::array();
  for (const Damage& each : damage_) {
    object["damage"].push_back({{"kind", each.where},
                                {"line", each.line},
                                {"byte", each.offset},
                                {"reason", each.reason}});
  }
  return object;
}

}  // namespace r4::tool
