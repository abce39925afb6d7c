// SPDX-License-Identifier: GPL-3.0-or-later
// Each description that is shipped, against the model of its device on a simulated board.
#include <gtest/gtest.h>

#include <numbers>
#include <string>

#include "r4link/board.hpp"
#include "r4link/devices/device.hpp"
#include "r4link/error.hpp"
#include "tests/support/at_will.hpp"
#include "tests/support/board_in_a_thread.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;

// With the script everything is on the bus.
constexpr const char* all_connected =
    "0 device icm20948 on\n0 device bno055 on\n0 device vl53l0x on\n0 device as5600 on\n";

class DescribedDevice : public testing::Test {
 protected:
  DescribedDevice() { board_.wait_active(); }

  // Waits for a value; fails the test if it does not come.
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

TEST_F(DescribedDevice, AMpu6050FeelsGravity) {
  const Device imu = Device::from("mpu6050@0x68");
  board_.attach(imu);
  EXPECT_NEAR(wait_for(imu, "accel_z"), 9.80665, 1e-9);
  const ReceivedState state = board_.state();
  EXPECT_EQ(imu.reading(state, "accel_x").number, 0.0);
  EXPECT_EQ(imu.reading(state, "gyro_z").number, 0.0);
  EXPECT_NEAR(imu.reading(state, "temperature").number.value(), 25.0, 0.01);
  EXPECT_TRUE(state.present.has(StateField::ain24)) << "the fields of before are still sent";
}

TEST_F(DescribedDevice, AnIcm20948FeelsGravityWhateverItWasSetToBefore) {
  for (const auto& bytes : {Board::I2c::Bytes{0x7F, 0x20}, Board::I2c::Bytes{0x14, 0x07},
                            Board::I2c::Bytes{0x7F, 0x00}}) {
    board_.i2c().write(0x69, bytes);  // 16 g
  }
  const Device imu = Device::from("icm20948@0x69");
  board_.attach(imu);
  EXPECT_NEAR(wait_for(imu, "accel_z"), 9.80665, 1e-9);
  EXPECT_NEAR(wait_for(imu, "temperature"), 21.0, 0.01);
}

TEST_F(DescribedDevice, ABno055SaysWhereItIsTurned) {
  const Device imu = Device::from("bno055");
  board_.attach(imu);
  EXPECT_NEAR(wait_for(imu, "accel_z"), 9.81, 1e-9);
  EXPECT_EQ(wait_for(imu, "calibrated"), 3.0);
  const ReceivedState state = board_.state();
  EXPECT_EQ(imu.reading(state, "heading").number, 270.0);
  EXPECT_NEAR(imu.reading(state, "quat_z").number.value(), std::numbers::sqrt2 / 2, 1e-4);
  EXPECT_EQ(imu.reading(state, "mag_x").number, 22.0);
  EXPECT_EQ(imu.reading(state, "temperature").number, 25.0);
  EXPECT_LE(static_cast<std::int32_t>(state.t_ms - imu.reading(state, "accel_z").t_ms), 1000);
}

TEST_F(DescribedDevice, AnIna219MeasuresAndNothingIsWrittenToIt) {
  const Device power = Device::from("ina219");
  board_.attach(power);
  EXPECT_NEAR(wait_for(power, "voltage"), 12.16, 1e-9);
  EXPECT_NEAR(wait_for(power, "current"), 1.25, 1e-9);
  for (const std::string& command : simulated_.executed()) {
    EXPECT_FALSE(command.starts_with("X:WRITE")) << command;
  }
}

TEST_F(DescribedDevice, AVl53l0xRangesAndSaysNothingWhereThereIsNothing) {
  const Device range = Device::from("vl53l0x");
  board_.attach(range);
  EXPECT_NEAR(wait_for(range, "distance"), 0.5, 1e-9);
  EXPECT_EQ(wait_for(range, "status"), 11.0);
  EXPECT_EQ(wait_for(range, "signal"), 10.0);
}

TEST_F(DescribedDevice, AnAs5600SaysItsAngle) {
  const Device angle = Device::from("as5600");
  board_.attach(angle);
  EXPECT_NEAR(wait_for(angle, "angle"), std::numbers::pi / 2, 1e-9);
  EXPECT_EQ(wait_for(angle, "magnet"), 1.0);
}

TEST_F(DescribedDevice, ThatWasResetMeasuresNothingUntilItIsSetUpAgain) {
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

TEST_F(DescribedDevice, SeveralAreReadSideBySide) {
  const auto devices = Device::from({"bno055", "ina219", "as5600@0x36:7"});
  for (const Device& each : devices) board_.attach(each);
  EXPECT_NEAR(wait_for(devices[2], "angle"), std::numbers::pi / 2, 1e-9);
  EXPECT_NEAR(wait_for(devices[1], "voltage"), 12.16, 1e-9);
  EXPECT_NEAR(wait_for(devices[0], "accel_z"), 9.81, 1e-9);
}

}  // namespace
}  // namespace r4::test
