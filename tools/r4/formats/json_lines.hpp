// SPDX-License-Identifier: GPL-3.0-or-later
// .jsonl: one JSON object for each record, its datagram as in `r4 decode`.
//     {"time":1795468293.405588,"path":1,"board":"arm","from":"board","ok":true,"type":"state",…}
//     {"time":1795468293.404765,"path":1,"board":"arm","type":"event","event":"up udp://10.0.0.7"}
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "../shell/json.hpp"
#include "conversion.hpp"
#include "path_names.hpp"
#include "r4link/devices/device.hpp"
#include "r4link/recordings/recorded_states.hpp"
#include "recorded_devices.hpp"

namespace r4::tool {

// Bytes that are not printable ASCII become \xNN.
void add_record_json(Json& object, const Record& record);

// Adds device values: "devices":{"bno055@0x28":{"accel_x":0.02,…}}; null: not valid.
class MeasuredJson {
 public:
  void add_to(Json& object, const Record& record, const RecordedDevices& devices);
  void on_header() { states_.clear(); }

 private:
  RecordedStates states_;
};

class JsonLinesSink final : public Sink {
 public:
  explicit JsonLinesSink(Output& output, std::vector<Device> devices = {})
      : output_(output), devices_(std::move(devices)) {}
  bool wants_survey() const override { return true; }
  void survey(const RecordedPath& path) override { names_.on_path(path); }
  void survey(const Record&) override {}
  void on_comment(std::string_view, Time) override {}
  void on_path(const RecordedPath& path, Time) override { names_.on_path(path); }
  void on_device(const RecordedDevice& device) override { devices_.on_device(device); }
  void on_header() override {
    devices_.on_header();
    measured_.on_header();
  }
  void on_record(const Record& record) override;
  void finish() override {}
  std::string left_out() const override { return devices_.problems(); }

 private:
  Output& output_;
  RecordedDevices devices_;
  MeasuredJson measured_;
  PathNames names_;
};

}  // namespace r4::tool
