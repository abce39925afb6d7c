// SPDX-License-Identifier: GPL-3.0-or-later
// .csv: one row for each state, one column for each value, with its unit in the header (RFC 4180).
//     time [s],path,board,PNum,T [ms],AIN24 [V],OSMC1 pwm [0-4095],OSMC1 direction [0/1]
//     1795468293.405588,1,left-arm,7434,79090,24.28,400,1
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "conversion.hpp"
#include "path_names.hpp"
#include "r4link/devices/device.hpp"
#include "r4link/recordings/recorded_states.hpp"
#include "recorded_devices.hpp"

namespace r4::tool {

class CsvSink final : public Sink {
 public:
  // Device values get columns too. If `devices` is empty, the recording's devices are used.
  explicit CsvSink(Output& output, std::vector<Device> devices = {});
  bool wants_survey() const override { return true; }
  void survey(const RecordedPath& path) override { names_.on_path(path); }
  void survey(const RecordedDevice& device) override;
  void survey(const Record& record) override;
  void on_comment(std::string_view, Time) override {}
  void on_path(const RecordedPath& path, Time) override { names_.on_path(path); }
  void on_device(const RecordedDevice& device) override;
  void on_header() override;
  void on_record(const Record& record) override;
  void finish() override;
  std::string left_out() const override;

 private:
  const State* read(const Record& record);
  void write_header();
  struct DeviceColumn {
    std::string device;
    std::string value;
    std::string unit;
  };
  void add_columns(const Device& device);
  void append_measured(const DeviceColumn& column, std::uint16_t path, const State& state);

  Output& output_;
  RecordedDevices devices_;
  RecordedDevices surveyed_;
  std::vector<DeviceColumn> device_columns_;
  PathNames names_;
  RecordedStates states_;
  FieldSet columns_;
  bool begun_ = false;
  std::string row_;
  std::uint64_t others_ = 0;
  std::string late_;  // a device reported after the columns were written
};

}  // namespace r4::tool
