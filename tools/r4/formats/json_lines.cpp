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
  add_datagram_json(object, record.bytes);
}

void JsonLinesSink::on_record(const Record& record) {
  Json object{{"time", static_cast<double>(record.time.count()) / 1e6}, {"path", record.path}};
  if (record.path != no_path) object["board"] = names_.of(record.path);
  add_record_json(object, record);
  measured_.add_to(object, record, devices_);
  output_.write(line_of(object));
}

void MeasuredJson::add_to(Json& object, const Record& record, const RecordedDevices& devices) {
  if (devices.all().empty()) return;
  const State* const state = states_.take(record);
  if (state == nullptr) return;
  for (const RecordedDevices::Known& known : devices.all()) {
    if (!known.is_of(record.path)) continue;
    const Device& device = known.device;
    const std::vector<DeviceValue>& values = device.description().values;
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (!state->present.has(device.field(i))) continue;
      const auto number = device.reading(*state, i).number;
      object["devices"][device.text()][values[i].name] = number ? Json(*number) : Json();
    }
  }
}

}  // namespace r4::tool
