// SPDX-License-Identifier: GPL-3.0-or-later
#include "recorded_devices.hpp"

#include <cstddef>
#include <utility>

#include "r4link/error.hpp"

namespace r4::tool {
namespace {

// Enough for a recording of a thousand boards; limits memory for damaged or malicious files.
constexpr std::size_t most_devices = 8000;
constexpr std::size_t most_problems = 1000;  // bytes

}  // namespace

RecordedDevices::RecordedDevices(std::vector<Device> named) : named_(!named.empty()) {
  for (Device& each : named) all_.push_back({no_path, std::move(each)});
}

const Device* RecordedDevices::on_device(const RecordedDevice& told) {
  if (named_) return nullptr;
  try {
    Device device = Device::parse(told.place, told.description);
    std::erase_if(all_, [&](const Known& each) {
      return each.path == told.path && device.takes_place_of(each.device);
    });
    if (all_.size() < most_devices) {
      return &all_.emplace_back(Known{told.path, std::move(device)}).device;
    }
    add_problem(told.place + ": more devices than r4 reads");
  } catch (const Error& error) {
    add_problem(error.what());
  }
  return nullptr;
}

void RecordedDevices::add_problem(const std::string& text) {
  if (problems_.size() > most_problems || problems_.find(text) != std::string::npos) return;
  problems_ += (problems_.empty() ? "" : ", ") + text;
}

void RecordedDevices::on_header() {
  if (!named_) all_.clear();
}

}  // namespace r4::tool
