// SPDX-License-Identifier: GPL-3.0-or-later
// The shipped descriptions with the models of their devices on a simulated board.
#include <gtest/gtest.h>

#include <numbers>
#include <string>
#include <vector>

#include "r4link/board.hpp"
#include "r4link/devices/device.hpp"
#include "r4link/error.hpp"
#include "tests/support/at_will.hpp"
#include "tests/support/board_in_a_thread.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;

constexpr const char* all_connected =
    "0 device icm20948 on\n0 device bno055 on\n0 device vl53l0x on\n0 device as5600 on\n";

class DescribedDevice : public testing::Test {
 protected:
  DescribedDevice() { board_.wait_active(); }

  // Waits for a value. The test fails if the value does not arrive.
  double wait_for(const Device& device, std::string_view value) {
    for (int i = 0; i < 300; ++i) {
      const auto reading = device.reading(board_.next_state(), value);
      if (reading.number) return *reading.number;
    }
    ADD_FAILURE() << device.text() << " has no " << value;
    return 0;
  }

  BoardInAThread simulated_{"udp", all_connected};
  Board board_{simulated_.url(), at_will()};
};

struct Measured {
  const char* device;
  std::vector<std::pair<const char*, double>> values;
};
struct ShippedDevice : DescribedDevice, testing::WithParamInterface<Measured> {};
const Measured all_measured[] = {
    {"mpu6050@0x68", {{"accel_z", 9.80665}, {"accel_x", 0}, {"gyro_z", 0}, {"temperature", 25.0}}},
    {"icm20948@0x69", {{"accel_z", 9.80665}, {"temperature", 21.0}}},
    {"bno055",
     {{"calibrated", 3},
      {"accel_z", 9.81},
      {"heading", 270},
      {"quat_z", 11585.0 / 16384},
      {"mag_x", 22},
      {"temperature", 25}}},
    {"ina219", {{"voltage", 12.16}, {"current", 1.25}}},
    {"vl53l0x", {{"distance", 0.5}, {"status", 11}, {"signal", 10}}},
    {"as5600", {{"angle", std::numbers::pi / 2}, {"magnet", 1}}},
};
INSTANTIATE_TEST_SUITE_P(Attach, ShippedDevice, testing::ValuesIn(all_measured),
                         [](const auto& each) {
                           return Device::from(each.param.device).description().name;
                         });

TEST_P(ShippedDevice, MeasuresCorrectlyAfterAnyEarlierSetting) {
  for (const auto& bytes : {Board::I2c::Bytes{0x7F, 0x20}, Board::I2c::Bytes{0x14, 0x07},
                            Board::I2c::Bytes{0x7F, 0x00}}) {
    board_.i2c().write(0x69, bytes);  // sets the ICM-20948 to 16 g
  }
  const Device device = Device::from(GetParam().device);
  board_.attach(device);
  for (const auto& [value, number] : GetParam().values) {
    const double tolerance = std::string_view(value) == "temperature" ? 0.01 : 1e-9;
    EXPECT_NEAR(wait_for(device, value), number, tolerance) << value;
    const ReceivedState state = board_.state();
    EXPECT_LE(static_cast<std::int32_t>(state.t_ms - device.reading(state, value).t_ms), 1000);
  }
}

TEST_F(DescribedDevice, MeasuresNothingAfterAResetUntilItIsSetUpAgain) {
  for (const auto& [name, value] :
       {std::pair("mpu6050", "accel_z"), std::pair("icm20948@0x69", "accel_z"),
        std::pair("bno055", "accel_z"), std::pair("vl53l0x", "signal")}) {
    const Device device = Device::from(name);
    board_.attach(device);
    const double measured = wait_for(device, value);
    simulated_.run([&](sim::SimulatedBoard& board) {
      board.happen(
          sim::Script::parse_now("device " + device.description().name + " reset", "test").value());
    });
    ReceivedState state;
    do {
      state = board_.next_state();
    } while (device.is_set_up(state) != false);
    for (int i = 0; i < 30; ++i) {
      EXPECT_FALSE(device.reading(state, value).number) << name;
      state = board_.next_state();
    }
    board_.attach(device);
    EXPECT_EQ(wait_for(device, value), measured) << name;
    for (int slot = device.first_slot(); slot <= device.last_slot(); ++slot) {
      board_.i2c().poll_off(slot);
    }
  }
}

}  // namespace
}  // namespace r4::test
