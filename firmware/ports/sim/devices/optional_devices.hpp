// SPDX-License-Identifier: GPL-3.0-or-later
// Devices that can join the devices of user_devices.hpp on the user's bus.
#pragma once

#include <cstdint>

#include "as5600_model.hpp"
#include "bno055_model.hpp"
#include "icm20948_model.hpp"
#include "user_bus_model.hpp"
#include "vl53l0x_model.hpp"

namespace r4 {
namespace sim {

constexpr int optional_device_count = 4;

struct OptionalDevices {
  explicit OptionalDevices(UserBusModel& bus) {
    for (int i = 0; i < optional_device_count; ++i) {
      bus.attach((*this)[i]);
      bus.connect((*this)[i], false);
    }
  }
  OptionalDevices(const OptionalDevices&) = delete;
  OptionalDevices& operator=(const OptionalDevices&) = delete;

  I2cChipModel& operator[](int device) {
    if (device == 0) return icm20948;
    if (device == 1) return bno055;
    if (device == 2) return vl53l0x;
    return as5600;
  }
  void power_on() {
    for (int i = 0; i < optional_device_count; ++i) (*this)[i].power_on();
  }

  Icm20948Model icm20948;
  Bno055Model bno055;
  Vl53l0xModel vl53l0x;
  As5600Model as5600;
};

}  // namespace sim
}  // namespace r4
