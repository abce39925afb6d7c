// SPDX-License-Identifier: GPL-3.0-or-later
#include "schemas.hpp"

#include <fmt/format.h>

#include "../../shell/json.hpp"
#include "mcap.hpp"
#include "r4link/tables/state_fields.hpp"

namespace r4::tool::mcap {
namespace {

Json of_type(const char* type, const char* description) {
  return {{"type", type}, {"description", description}};
}

Json field_schema(StateField field) {
  const FieldKindRow& kind = kind_row_of(field);
  const int count = kind.value_count();
  std::string values;  // "pwm [0-4095], direction [0/1]"
  for (int i = 0; i < count; ++i) {
    const auto& [name, unit] = kind.values[i];
    values += fmt::format("{}{}{}[{}]", i == 0 ? "" : ", ", name, *name == '\0' ? "" : " ", unit);
  }
  Json schema = of_type(count == 1 ? "number" : "array", (values + ": " + kind.help).c_str());
  if (count > 1 && !kind.has_bytes()) schema["items"] = {{"type", "number"}};
  return schema;
}

std::string text_of(std::string_view title, const Json& properties) {
  return Json{{"$schema", "https://json-schema.org/draft/2020-12/schema"},
              {"title", title},
              {"type", "object"},
              {"properties", properties}}
      .dump();
}

}  // namespace

std::string record_schema_text() {
  Json fields = Json::object();
  for (const StateFieldRow& row : state_fields) {
    fields[std::string(row.name.data(), row.name.size())] = field_schema(row.field);
  }
  Json all = of_type("object", "the fields of the datagram, except PNum and T");
  all["properties"] = fields;
  Json measured = of_type("object", "measurements of described devices, by device and value");
  measured["additionalProperties"] = {{"type", "object"},
                                      {"additionalProperties", {{"type", {"number", "null"}}}}};
  return text_of(
      record_schema,
      {{"from", of_type("string", "board or host")},
       {"ok", of_type("boolean", "true if the datagram is valid")},
       {"type", of_type("string", "state, heartbeat, command, nack, identity or event")},
       {"pnum", of_type("integer", "packet number")},
       {"t", of_type("integer", "the board's clock [ms]")},
       {"fields", all},
       {"devices", measured},
       {"error", of_type("string", "the error of a damaged datagram: length, syntax or crc")},
       {"position", of_type("integer", "the byte at which the error is")},
       {"text", of_type("string", "the original text of the datagram")},
       {"event", of_type("string", "the event of the link")}});
}

std::string line_schema_text() {
  return text_of(line_schema, {{"line", of_type("string", "a line of the native format")}});
}

std::string link_schema_text() {
  Json causes = of_type("array", "the faults of the link, the gravest first");
  causes["items"] = {{"type", "string"}};
  return text_of(
      "r4.Link",
      {{"name", of_type("string", "the board's name")},
       {"firmware", of_type("string", "the version of the firmware")},
       {"id", of_type("string", "the id of the hardware")},
       {"link", of_type("string", "connecting, active, safe, lost or down")},
       {"causes", causes},
       {"why", of_type("string", "the faults in words")},
       {"controlled", of_type("boolean", "true if the board accepts commands of this program")},
       {"armed", of_type("boolean", "true if the board accepts commands that drive outputs")},
       {"safe", of_type("string", "the reason why all outputs are off; empty if they are not")},
       {"rate_hz", of_type("number", "states a second")},
       {"loss", of_type("number", "the share of lost datagrams, 0 to 1")},
       {"round_trip_ms", of_type("number", "the time from a question to its answer [ms]")},
       {"age_ms", of_type("number", "the time since the newest state arrived [ms]")}});
}

std::string event_schema_text() {
  return text_of("r4.Event", {{"time_ms", of_type("integer", "the time since 1970 [ms]")},
                              {"board", of_type("integer", "the number of the board, from 0")},
                              {"level", of_type("string", "info, warning or error")},
                              {"text", of_type("string", "the event in words")}});
}

}  // namespace r4::tool::mcap
