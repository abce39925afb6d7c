// SPDX-License-Identifier: GPL-3.0-or-later
#include "bus_records.hpp"

#include <fmt/format.h>

#include "../bus/bus_datagram.hpp"
#include "../bus/candump.hpp"
#include "../shell/number.hpp"
#include "r4link/discovery/url.hpp"
#include "r4link/messages/packed_form.hpp"
#include "r4link/vocabulary.hpp"

namespace r4::tool {
namespace {

Time time_of(const BusTransfers::LogPosition& position) {
  return Time{static_cast<std::int64_t>(position.time_us.value_or(0))};
}

}  // namespace

std::string bus_url(std::string_view interface, std::uint8_t node) {
  std::string host = percent_encoded(interface);
  if (host != interface || host.find(':') != std::string::npos) host = "[" + host + "]";
  return fmt::format("can://{}?node={}", host, node);
}

std::string bus_interface(const std::string& host) {
  std::string name;
  for (std::size_t i = 0; i < host.size(); ++i) {
    if (host[i] != '%') {
      name += host[i];
    } else if (const auto code =
                   number_in<std::uint8_t>(std::string_view(host).substr(i + 1, 2), 16)) {
      name += static_cast<char>(*code);
      i += 2;
    } else {
      return host;
    }
  }
  return is_interface_name(name) ? name : host;
}

void BusRecords::on_frame(std::string_view interface, const CanFrame& frame,
                          const BusTransfers::LogPosition& position) {
  transfers_.pass_time(position.time_us);
  if (transfers_.on_frame(interface, frame, position) == BusTransfers::Frame::too_many_interfaces) {
    damage(position, "a frame of an interface after the first 32");
  }
}

void BusRecords::finish() {
  for (const BusTransfers::Lane* const lane : transfers_.unfinished()) {
    damage(lane->last, "a datagram whose rest is missing");
  }
}

void BusRecords::on_datagram(const BusTransfers::Lane& lane) {
  UnpackRoom room;
  const PlainForm plain = plain_form(lane.receiver.data(), lane.receiver.size(), room);
  if (plain.problem != nullptr) {
    return damage(lane.last, fmt::format("a packed datagram that is not valid: {}", plain.problem));
  }
  const std::uint16_t path = path_of(lane.interface, lane.meaning.node);
  const bool from_host = lane.meaning.kind == CanIdKind::command;
  tell({time_of(lane.last), path, from_host ? RecordKind::to_board : RecordKind::from_board,
        plain.bytes});
}

void BusRecords::on_failure(const BusTransfers::Lane& lane,
                            const BusTransfers::LogPosition& position, IsotpError error) {
  const Text reason = to_text(error);
  damage(position, fmt::format("an incomplete datagram of node {}: {}", lane.meaning.node,
                               std::string_view(reason.data(), reason.size())));
}

void BusRecords::on_raw_frame(const std::string& interface, const CanIdMeaning& meaning,
                              const CanFrame& frame, const BusTransfers::LogPosition& position) {
  if (meaning.kind == CanIdKind::emergency_stop) {
    return tell({time_of(position), no_path, RecordKind::event, "stop " + interface});
  }
  if (meaning.kind == CanIdKind::watch) return;  // not from the board
  const std::uint8_t number = frame.size == 0 ? 0 : frame.data[0];
  const SafeReason reason = number == 0 ? SafeReason::fault : to_safe_reason(number);
  const std::string words = fmt::format("link safe {}", to_text(reason));
  tell({time_of(position), path_of(interface, meaning.node), RecordKind::event, words});
}

std::uint16_t BusRecords::path_of(const std::string& interface, std::uint8_t node) {
  const auto [known, added] = paths_.try_emplace({interface, node}, no_path);
  if (added) known->second = add_path(bus_url(interface, node));
  return known->second;
}

std::uint16_t BusRecords::add_path(const std::string& url) {
  visitor_.on_path({++last_path_, url, ""});
  return last_path_;
}

void BusRecords::tell(const Record& record) {
  told_ = true;
  visitor_.on_record(record);
}

void BusRecords::damage(const BusTransfers::LogPosition& position, const std::string& reason) {
  told_ = true;
  visitor_.on_damage({RecordingDamage::Kind::line, position.line, position.offset, reason});
}

}  // namespace r4::tool
