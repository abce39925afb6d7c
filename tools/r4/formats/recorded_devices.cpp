// SPDX-License-Identifier: GPL-3.0-or-later
#include "recorded_devices.hpp"

#include <utility>

#include "r4link/error.hpp"

namespace r4::tool {

RecordedDevices::RecordedDevices(std::vector<Device> named) : named_(!named.empty()) {
  for (Device& each : named) all_.push_back({no_wire, std::move(each)});
}

void RecordedDevices::on_device(const RecordedDevice& told) {
  if (named_) return;
  try {
    Device device = Device::parse(told.place, told.description);
    std::erase_if(all_, [&](const Known& each) {
      return each.wire == told.wire && each.device.first_slot() <= device.last_slot() &&
             each.device.last_slot() >= device.first_slot();
    });
    all_.push_back({told.wire, std::move(device)});
  } catch (const Error& error) {
    if (problems_.find(error.what()) != std::string::npos) return;
    problems_ += (problems_.empty() ? "" : ", ") + std::string(error.what());
  }
}

void RecordedDevices::on_header() {
  if (!named_) all_.clear();
}

}  // namespace r4::tool
