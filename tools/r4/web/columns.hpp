// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "../shell/json.hpp"
#include "r4link/datagram.hpp"
#include "r4link/devices/device.hpp"
#include "r4link/state.hpp"

namespace r4::tool::web {

class Columns {
 public:
  // Columns of all state fields, then of the values of `devices`: "bno055@0x28.accel_x".
  explicit Columns(std::vector<Device> devices = {});
  std::size_t size() const { return names_.size(); }
  // "AIN24", "OSMC1.pwm"; units() has the same size: "V".
  const std::vector<std::string>& names() const { return names_; }
  const std::vector<std::string>& units() const { return units_; }
  // Copies values to their columns of `row`, which has size() elements; other elements stay.
  void fill(const Datagram& state, std::vector<double>& row) const;

 private:
  const std::vector<Device> devices_;
  std::vector<std::string> names_;
  std::vector<std::string> units_;
  std::array<std::size_t, state_field_count> first_{};
  std::size_t first_of_devices_ = 0;
};

Json channels_json();

}  // namespace r4::tool::web
