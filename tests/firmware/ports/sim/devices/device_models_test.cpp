// SPDX-License-Identifier: GPL-3.0-or-later
// The models of the devices on the user's I2C bus have the registers of their data sheets.
#include <gtest/gtest.h>

#include <vector>

#include "firmware/ports/sim/devices/user_devices.hpp"

namespace r4::sim {
namespace {

using Progress = firmware::UserI2cPort::Progress;
using Bytes = std::vector<std::uint8_t>;

class UserDeviceModels : public testing::Test {
 protected:
  Bytes read(std::uint8_t address, const Bytes& out, std::size_t count) {
    Bytes in(count);
    firmware::UserTransfer transfer;
    transfer.address = address;
    transfer.out = out.data();
    transfer.out_size = out.size();
    transfer.in = in.data();
    transfer.in_size = count;
    devices.bus.begin(transfer);
    devices.bus.advance(10'000);
    return devices.bus.progress() == Progress::done ? in : Bytes{};
  }
  void write(std::uint8_t address, const Bytes& out) { read(address, out, 0); }
  UserDevices devices;
};

TEST_F(UserDeviceModels, Mpu6050SleepsUntilItIsWoken) {
  EXPECT_EQ(read(0x68, {0x75}, 1), Bytes{0x68});
  EXPECT_EQ(read(0x68, {0x6B}, 1), Bytes{0x40});
  EXPECT_EQ(read(0x68, {0x3B}, 14), Bytes(14));
  write(0x68, {0x6B, 0x00});
  // 1 g down, 25.00 degrees: (25.00 - 36.53) * 340 = -3920.
  EXPECT_EQ(read(0x68, {0x3B}, 14), (Bytes{0, 0, 0, 0, 0x40, 0, 0xF0, 0xB0, 0, 0, 0, 0, 0, 0}));
  write(0x68, {0x1C, 0x18});  // 16 g
  EXPECT_EQ(read(0x68, {0x3F}, 2), (Bytes{0x08, 0x00}));
  write(0x68, {0x6B, 0x80});  // reset
  EXPECT_EQ(read(0x68, {0x1C}, 1), Bytes{0x00});
  EXPECT_EQ(read(0x68, {0x6B}, 1), Bytes{0x40});
}

TEST_F(UserDeviceModels, Mpu6050ReportsTheSetMotionWithoutOverflow) {
  write(0x68, {0x6B, 0x00});
  devices.mpu6050.feel({-1000, 500, 3000}, {100, -250, 0}, 3653);
  EXPECT_EQ(read(0x68, {0x3B}, 14),
            (Bytes{0xC0, 0x00, 0x20, 0x00, 0x7F, 0xFF, 0, 0, 0x33, 0x2C, 0x80, 0x12, 0, 0}));
  write(0x68, {0x75, 0x11});
  EXPECT_EQ(read(0x68, {0x75}, 1), Bytes{0x68}) << "the register cannot be written";
}

TEST_F(UserDeviceModels, Ina219ConvertsByItsCalibration) {
  EXPECT_EQ(read(0x40, {0x00}, 2), (Bytes{0x39, 0x9F}));
  devices.ina219.measure(11980, 20000);  // the example of data sheet 8.5.1
  EXPECT_EQ(read(0x40, {0x01}, 2), (Bytes{0x07, 0xD0}));
  EXPECT_EQ(read(0x40, {0x02}, 2), (Bytes{0x5D, 0x9A}));  // 2995 << 3 and CNVR
  EXPECT_EQ(read(0x40, {0x04}, 2), (Bytes{0x00, 0x00})) << "without a calibration";
  write(0x40, {0x05, 0x50, 0x00});
  EXPECT_EQ(read(0x40, {0x04}, 2), (Bytes{0x27, 0x10}));
  EXPECT_EQ(read(0x40, {0x03}, 2), (Bytes{0x17, 0x66}));
  write(0x40, {0x00, 0x80, 0x00});
  EXPECT_EQ(read(0x40, {0x05}, 2), (Bytes{0x00, 0x00}));
  devices.ina219.measure(11980, -500000);
  EXPECT_EQ(read(0x40, {0x01}, 2), (Bytes{0x83, 0x00})) << "the range ends at 320 mV";
}

TEST_F(UserDeviceModels, ATransferTakesItsTimeOnTheWire) {
  const std::uint8_t at = 0x3B;
  std::uint8_t in[14];
  firmware::UserTransfer transfer;
  transfer.address = 0x68;
  transfer.out = &at;
  transfer.out_size = 1;
  transfer.in = in;
  transfer.in_size = sizeof in;
  devices.bus.begin(transfer);
  // 17 bytes of nine clocks, two STARTs and a STOP, at 100 kHz.
  devices.bus.advance(1559);
  EXPECT_EQ(devices.bus.progress(), Progress::busy);
  devices.bus.advance(1);
  EXPECT_EQ(devices.bus.progress(), Progress::done);
}

}  // namespace
}  // namespace r4::sim
