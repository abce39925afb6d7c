// SPDX-License-Identifier: GPL-3.0-or-later
// .jsonl: every record of a recording, one JSON object a line, its datagram as `r4 decode` shows it.
//
//     {"time":1795468293.405588,"wire":1,"board":"left-arm","from":"board","ok":true,"type":"state",…}
//     {"time":1795468293.404765,"wire":1,"board":"left-arm","type":"event","event":"up udp://192.168.0.125"}
#pragma once

#include <utility>
#include <vector>

#include "../shell/json.hpp"
#include "conversion.hpp"
#include "r4link/datagram.hpp"
#include "r4link/devices/device.hpp"
#include "r4link/state.hpp"
#include "wire_names.hpp"

namespace r4::tool {

// What a record is, as JSON, appended to `object`: a datagram's `from`, `ok`, `type`, `pnum`, `t`, `fields`, `text`, or
// an event's `type` and `event`. Bytes that are no printable ASCII are \xNN in `text` and `event`.
void add_record_json(Json& object, const Record& record);

class JsonLinesSink final : public Sink {
 public:
  // Of `devices`, what they have measured is told, too.
  explicit JsonLinesSink(Output& output, std::vector<Device> devices = {})
      : output_(output), devices_(std::move(devices)) {}
  bool wants_survey() const override { return true; }
  void survey(const RecordedWire& wire) override { names_.on_wire(wire); }
  void survey(const Record&) override {}
  void on_comment(std::string_view, Time) override {}
  void on_wire(const RecordedWire& wire, Time) override { names_.on_wire(wire); }
  void on_record(const Record& record) override;
  void finish() override {}

 private:
  void add_devices(Json& object, const Record& record);

  Output& output_;
  const std::vector<Device> devices_;
  Datagram datagram_;
  State state_;
  WireNames names_;
};

}  // namespace r4::tool
