// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "ina219_model.hpp"
#include "mpu6050_model.hpp"
#include "user_bus_model.hpp"
#include "user_uart_model.hpp"

namespace r4 {
namespace sim {

enum class UserDevice : std::uint8_t { mpu6050, ina219, count };
constexpr int user_device_count = static_cast<int>(UserDevice::count);

struct UserDevices {
  UserDevices() {
    for (int i = 0; i < user_device_count; ++i) bus.attach((*this)[static_cast<UserDevice>(i)]);
    uarts[0].connect(UartPeer::gnss);
    uarts[1].connect(UartPeer::lidar);
  }
  UserDevices(const UserDevices&) = delete;
  UserDevices& operator=(const UserDevices&) = delete;

  I2cChipModel& operator[](UserDevice device) {
    return device == UserDevice::ina219 ? static_cast<I2cChipModel&>(ina219) : mpu6050;
  }
  // Does not clear faults.
  void power_on() {
    for (int i = 0; i < user_device_count; ++i) (*this)[static_cast<UserDevice>(i)].power_on();
  }

  void reset() {
    bus.reset();
    for (UserUartModel& uart : uarts) uart.reset();
  }
  void pass_millisecond() {
    bus.advance(1000);
    for (UserUartModel& uart : uarts) uart.pass_millisecond();
  }

  UserBusModel bus;
  UserUartModel uarts[uart_channels];
  Mpu6050Model mpu6050;
  Ina219Model ina219;
};

}  // namespace sim
}  // namespace r4
