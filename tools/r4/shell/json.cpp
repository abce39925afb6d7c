// SPDX-License-Identifier: GPL-3.0-or-later
#include "json.hpp"

#include <fmt/format.h>

#include <array>
#include <set>
#include <string>
#include <vector>

#include "exit_code.hpp"
#include "r4link/messages/message.hpp"
#include "r4link/messages/packed_form.hpp"
#include "r4link/recordings/record_line.hpp"

namespace r4::tool {
namespace {

std::string_view view(Text text) { return {text.data(), text.size()}; }

}  // namespace

Json value_json(Text value) {
  const std::string_view text = view(value);
  const bool plain =
      !text.empty() && text.find_first_not_of("-.0123456789") == std::string_view::npos;
  if (plain) {
    Json number = Json::parse(text, nullptr, false);
    // A double would round an integer that does not fit into 64 bits.
    const bool exact = number.is_number_integer() || text.find('.') != std::string_view::npos;
    if (number.is_number() && exact) return number;
  }
  return text;
}

Json field_json(const Field& field) {
  std::vector<Text> values(field.count());
  field.split(values.data(), values.size());
  if (values.size() == 1) return value_json(values[0]);
  Json array = Json::array();
  for (const Text value : values) array.push_back(value_json(value));
  return array;
}

Json fields_json(const Datagram& datagram) {
  Json fields = Json::object();
  std::set<std::string> repeated;
  for (const Field& field : datagram) {
    if (field.name() == Text("PNum") || field.name() == Text("T")) continue;
    const std::string name(view(field.name()));
    const auto earlier = fields.find(name);
    if (earlier == fields.end()) {
      fields.emplace(name, field_json(field));
    } else if (repeated.insert(name).second) {
      *earlier = Json::array({std::move(*earlier), field_json(field)});
    } else {
      earlier->push_back(field_json(field));
    }
  }
  return fields;
}

Json bad_datagram_json(const ReadResult& result) {
  Json object{{"error", to_text(result.error)}, {"position", result.position}};
  if (result.error == ReadError::crc) {
    object["expected"] = fmt::format("{:#x}", result.crc_expected);
    object["found"] = fmt::format("{:#x}", result.crc_found);
  }
  return object;
}

bool add_datagram_json(Json& object, std::string_view bytes) {
  const Text text = bytes;
  Datagram datagram;
  const ReadResult result = read_datagram(text, datagram);
  object["ok"] = static_cast<bool>(result);
  std::vector<char> room(text.size() + masking_room);
  const Text masked = without_secrets(text, room.data());
  if (result && masked.data() != text.data()) (void)read_datagram(masked, datagram);
  if (result) {
    object["type"] = to_text(kind_of(datagram));
    object["pnum"] = datagram.has_pnum() ? Json(datagram.pnum()) : Json();
    object["t"] = datagram.has_time() ? Json(datagram.time_ms()) : Json();
    object["fields"] = fields_json(datagram);
  } else {
    object.update(bad_datagram_json(result));
  }
  object["text"] = escaped(view(masked));
  return static_cast<bool>(result);
}

Json transfers_json(const CarrierCounters& counters) {
  if (!counters.transfers) return nullptr;
  const TransferCounters& transfers = *counters.transfers;
  return {{"wrong_sequence", transfers.wrong_sequence},
          {"timed_out", transfers.timed_out},
          {"overflow", transfers.overflow},
          {"interrupted", transfers.interrupted},
          {"cancelled", transfers.cancelled},
          {"unexpected", transfers.unexpected},
          {"malformed", transfers.malformed},
          {"packed", transfers.packed},
          {"bad_form", transfers.bad_form},
          {"dropped_frames", counters.rx_overflows}};
}

Json counters_json(const CarrierCounters& counters) {
  Json object{{"received", counters.rx_datagrams},
              {"sent", counters.tx_datagrams},
              {"dropped", counters.tx_dropped},
              {"errors", counters.tx_errors},
              {"oversize", counters.rx_oversize},
              {"foreign", counters.rx_foreign},
              {"downs", counters.downs}};
  Json transfers = transfers_json(counters);
  if (!transfers.is_null()) object["transfers"] = std::move(transfers);
  return object;
}

Json problem_json(const Problem& problem) {
  Json object{{"type", "error"},
              {"kind", row_of(problem.kind).name},
              {"thing", problem.thing},
              {"reason", problem.reason},
              {"fix", problem.fix}};
  if (problem.outcome != Outcome::none) object["outcome"] = to_text(problem.outcome);
  if (problem.refusal != Refusal::none) {
    const Text code = name_of(problem.refusal);
    object["code"] = std::string_view(code.data(), code.size());
  }
  if (problem.at != 0) object["at"] = problem.at;
  return object;
}

std::string escaped(std::string_view bytes) {
  std::string text;
  append_escaped(text, bytes);
  return text;
}

std::string text_of(const Json& value) {
  return value.dump(-1, ' ', true, Json::error_handler_t::replace);
}

std::string line_of(const Json& object) { return text_of(object) + "\n"; }

void print_line(const Json& object) { print_raw(line_of(object)); }

}  // namespace r4::tool
