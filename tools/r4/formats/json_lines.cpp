// SPDX-License-Identifier: GPL-3.0-or-later
#include "json_lines.hpp"

namespace r4::tool {

void add_record_json(Json& object, const Record& record) {
  if (record.kind == RecordKind::event) {
    object["type"] = "event";
    object["event"] = escaped(record.bytes);
    return;
  }
  object["from"] = record.kind == RecordKind::from_board ? "board" : "host";
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-reinterpret-cast): characters as bytes
  add_datagram_json(object, reinterpret_cast<const std::uint8_t*>(record.bytes.data()),
                    record.bytes.size(), DatagramForm::plain);
}

void JsonLinesSink::on_record(const Record& record) {
  Json object{{"time", static_cast<double>(record.time.count()) / 1e6}, {"wire", record.wire}};
  if (record.wire != no_wire) object["board"] = names_.of(record.wire);
  add_record_json(object, record);
  output_.write(line_of(object));
}

}  // namespace r4::tool
