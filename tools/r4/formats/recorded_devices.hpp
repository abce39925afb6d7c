// SPDX-License-Identifier: GPL-3.0-or-later
// Assigns bytes in a recording to the recorded devices of the path, or to the user's devices.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "r4link/devices/device.hpp"
#include "r4link/recordings/record.hpp"

namespace r4::tool {

class RecordedDevices {
 public:
  explicit RecordedDevices(std::vector<Device> named);

  // Replaces devices with the same address or slots. Returns null if the device is not accepted.
  const Device* on_device(const RecordedDevice& told);
  void on_header();

  struct Known {
    std::uint16_t path;  // no_path: every path
    Device device;
    bool is_of(std::uint16_t number) const { return path == no_path || path == number; }
  };
  const std::vector<Known>& all() const { return all_; }
  // Why some devices were not accepted, for people; empty: all were accepted.
  const std::string& problems() const { return problems_; }

 private:
  void add_problem(const std::string& text);

  const bool named_;
  std::vector<Known> all_;
  std::string problems_;
};

}  // namespace r4::tool
