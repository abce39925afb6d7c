// SPDX-License-Identifier: GPL-3.0-or-later
// Whose bytes are whose in a recording: the devices that it describes, of each path, or instead of them those that the
// user has named, of every path.
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

  // The recording tells of one, instead of what has had its address or slots. Nothing if it is not taken.
  const Device* on_device(const RecordedDevice& told);
  // Another recording begins, whose paths may be others.
  void on_header();

  struct Known {
    std::uint16_t path;  // no_path: each
    Device device;
    bool is_of(std::uint16_t number) const { return path == no_path || path == number; }
  };
  const std::vector<Known>& all() const { return all_; }
  // Why some are none, for people; empty: all are understood.
  const std::string& problems() const { return problems_; }

 private:
  void add_problem(const std::string& text);

  const bool named_;
  std::vector<Known> all_;
  std::string problems_;
};

}  // namespace r4::tool
