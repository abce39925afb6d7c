// SPDX-License-Identifier: GPL-3.0-or-later
// A state as a row of numbers: which column has which value of which field, with its unit; and which columns belong to
// which output channel.
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
  // The fields of a state, and behind them what `devices` measure: "bno055@0x28.accel_x".
  explicit Columns(std::vector<Device> devices = {});
  std::size_t size() const { return names_.size(); }
  // "AIN24", "OSMC1.pwm"; and as wide as that the units, "V".
  const std::vector<std::string>& names() const { return names_; }
  const std::vector<std::string>& units() const { return units_; }
  // What a state's datagram carries goes to its columns of `row`, which has size() of them; a value that is there
  // for none stays as it was.
  void fill(const Datagram& state, std::vector<double>& row) const;

 private:
  const std::vector<Device> devices_;
  std::vector<std::string> names_;
  std::vector<std::string> units_;
  std::array<std::size_t, state_field_count> first_{};
  std::size_t first_of_devices_ = 0;
};

// The output channels of a board, for the page.
Json channels_json();

}  // namespace r4::tool::web
