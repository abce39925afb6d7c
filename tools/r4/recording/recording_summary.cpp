// SPDX-License-Identifier: GPL-3.0-or-later
#include "recording_summary.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "formats.hpp"
#include "protocol/datagram/numbers.hpp"
#include "protocol/messages/message.hpp"
#include "r4link/state.hpp"

namespace r4::tool {
namespace {

// Of a file so damaged that it seems to have more wires, they are counted as one.
constexpr std::size_t most_wires = 1000;
// More than a board has slots are in no recording but one of many parts.
constexpr std::size_t most_devices = 64;

double seconds_of(Time time) { return std::chrono::duration<double>(time).count(); }

double rate_of(const WireSummary& wire) {
  const double heard = seconds_of(wire.last - wire.first);
  return heard > 0 && wire.states > 1 ? static_cast<double>(wire.states - 1) / heard : 0;
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

// What the files of one program have in common is one wire.
void RecordingSummary::on_wire(const RecordedWire& wire) {
  const auto known = std::find_if(wires_.begin(), wires_.end(), [&wire](const WireSummary& each) {
    return each.wire.number == wire.number && (each.wire.url == wire.url || each.wire.url.empty());
  });
  const auto index = static_cast<std::size_t>(known - wires_.begin());
  numbers_[wire.number] = known == wires_.end() ? add(wire.number) : index;
  of(wire.number).wire = wire;
}

void RecordingSummary::on_device(const RecordedDevice& device) {
  std::vector<std::string>& known = of(device.wire).devices;
  if (known.size() == most_devices || std::count(known.begin(), known.end(), device.place) != 0)
    return;
  known.push_back(device.place);
}

WireSummary& RecordingSummary::of(std::uint16_t number) {
  const auto known = numbers_.find(number);
  if (known != numbers_.end()) return wires_[known->second];
  return wires_[numbers_[number] = add(number)];
}

std::size_t RecordingSummary::add(std::uint16_t number) {
  if (wires_.size() < most_wires) {
    wires_.emplace_back();
    wires_.back().wire.number = number;
  }
  return wires_.size() - 1;
}

void RecordingSummary::on_record(const Record& record) {
  first_ = any_ ? std::min(first_, record.time) : record.time;
  last_ = any_ ? std::max(last_, record.time) : record.time;
  any_ = true;
  ++records_;
  if (record.kind == RecordKind::event) return on_event(record);
  WireSummary& wire = of(record.wire);
  if (record.kind == RecordKind::from_board) {
    on_received(wire, record);
  } else {
    on_sent(wire, record);
  }
}

void RecordingSummary::on_event(const Record& record) {
  if (record.wire == no_wire) {
    std::uint64_t count = 0;
    if (parse_number(Text(word_after(record.bytes, "dropped ")), count)) dropped_ += count;
    if (record.bytes == "end") ended_ = true;
  } else if (record.bytes.starts_with("down ")) {
    ++of(record.wire).downs;
  } else if (record.bytes.starts_with("oversize ")) {
    ++of(record.wire).oversize;
  }
}

void RecordingSummary::on_received(WireSummary& wire, const Record& record) {
  const bool heard = wire.received != 0;
  if (heard && record.time - wire.last > shortest_gap) {
    ++wire.gaps;
    if (record.time - wire.last > wire.longest_gap) {
      wire.longest_gap = record.time - wire.last;
      wire.longest_gap_at = wire.last;
    }
  }
  Datagram datagram;
  if (!read_datagram(Text(record.bytes), datagram)) {
    ++wire.damaged;
    return;
  }
  if (!heard) wire.first = record.time;
  wire.last = record.time;
  ++wire.received;
  const MessageKind kind = kind_of(datagram);
  if (kind == MessageKind::board_heartbeat && is_connecting_heartbeat(datagram)) {
    wire.packets.restart();
  } else if (datagram.has_pnum()) {
    wire.packets.on(datagram.pnum());
  }
  if (kind == MessageKind::state) ++wire.states;
  if (kind != MessageKind::state && kind != MessageKind::board_heartbeat) return;
  // A board that is not safe may leave it out.
  const Field safe = datagram.find("SAFE");
  std::uint32_t reason = 0;
  if (!safe.name().empty() && !parse_number(safe.values(), reason)) return;
  be_safe(wire, to_safe_reason(reason), record.time);
}

void RecordingSummary::be_safe(WireSummary& wire, SafeReason reason, Time now) {
  if (wire.safe != SafeReason::none) wire.safe_for += std::max(Time{0}, now - wire.safe_since);
  if (reason != wire.safe && reason != SafeReason::none) {
    ++wire.safe_times[static_cast<std::size_t>(reason)];
  }
  wire.safe = reason;
  wire.safe_since = now;
}

void RecordingSummary::on_sent(WireSummary& wire, const Record& record) {
  ++wire.sent;
  Datagram datagram;
  if (!read_datagram(Text(record.bytes), datagram)) return;
  if (kind_of(datagram) == MessageKind::host_heartbeat) ++wire.heartbeats;
  const Field stop = datagram.find("E");
  if (!stop.name().empty() && stop.values() == Text("STOP")) ++wire.stops;
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
  for (const WireSummary& each : wires_) {
    line(fmt::format("wire {}", each.wire.number).c_str(),
         each.wire.url + (each.wire.name.empty() ? "" : "  " + each.wire.name));
    line("", fmt::format(
                 "{} datagrams from the board: {} states, {:.1f} a second; {} damaged, {} lost{}",
                 each.received + each.damaged, each.states, rate_of(each), each.damaged,
                 each.packets.counters().lost,
                 each.oversize == 0 ? "" : fmt::format(", {} too long", each.oversize)));
    line("",
         fmt::format("{} to it: {} heartbeats, {} stops", each.sent, each.heartbeats, each.stops));
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
      line("", fmt::format("silent for more than {} s {} times; the longest {:.1f} s from {}",
                           shortest_gap / std::chrono::seconds{1}, each.gaps,
                           seconds_of(each.longest_gap), record_time_text(each.longest_gap_at)));
    }
    if (each.downs != 0) line("", fmt::format("the transport was lost {} times", each.downs));
  }
  if (dropped_ != 0) line("left out", fmt::format("{} records: the disk was too slow", dropped_));
  const std::uint64_t cut = unended_ + (ended_ ? 0 : 1);
  if (cut != 0) line("cut", "it was not ended: the recording program runs, or was killed");
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
  object["wires"] = Json::array();
  for (const WireSummary& each : wires_) {
    Json safe = Json::object();
    for (std::size_t i = 1; i < each.safe_times.size(); ++i) {
      if (each.safe_times[i] != 0) safe[to_text(static_cast<SafeReason>(i))] = each.safe_times[i];
    }
    object["wires"].push_back({{"wire", each.wire.number},
                               {"url", each.wire.url},
                               {"name", each.wire.name},
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
