// SPDX-License-Identifier: GPL-3.0-or-later
// The models of the optional devices on the user's I2C bus have the registers of their data sheets.
#include "firmware/ports/sim/devices/optional_devices.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace r4::sim {
namespace {

using Progress = firmware::UserI2cPort::Progress;
using Bytes = std::vector<std::uint8_t>;

class OptionalDeviceModels : public testing::Test {
 protected:
  OptionalDeviceModels() {
    for (int i = 0; i < optional_device_count; ++i) bus.connect(devices[i], true);
  }
  Bytes read(std::uint8_t address, const Bytes& out, std::size_t count) {
    Bytes in(count);
    firmware::UserTransfer transfer;
    transfer.address = address;
    transfer.out = out.data();
    transfer.out_size = out.size();
    transfer.in = in.data();
    transfer.in_size = count;
    bus.begin(transfer);
    bus.advance(10'000);
    return bus.progress() == Progress::done ? in : Bytes{};
  }
  void write(std::uint8_t address, const Bytes& out) { read(address, out, 0); }
  UserBusModel bus;
  OptionalDevices devices{bus};
};

TEST_F(OptionalDeviceModels, AreOnTheBusOnlyWhenTheyAreConnected) {
  for (int i = 0; i < optional_device_count; ++i) bus.connect(devices[i], false);
  for (const std::uint8_t address : Bytes{0x28, 0x29, 0x36, 0x69}) {
    EXPECT_EQ(read(address, {0x00}, 1), Bytes{}) << static_cast<int>(address);
  }
}

TEST_F(OptionalDeviceModels, Icm20948SleepsAndHasItsRangesInBank2) {
  EXPECT_EQ(read(0x69, {0x00}, 1), Bytes{0xEA});
  EXPECT_EQ(read(0x69, {0x06}, 1), Bytes{0x41});
  EXPECT_EQ(read(0x69, {0x2D}, 14), Bytes(14)) << "the device sleeps";
  write(0x69, {0x06, 0x01});
  devices.icm20948.feel({-1000, 500, 3000}, {100, -250, 0}, 2500);
  // In the range of 2 g, 1 g is 16384. In the range of 250 degrees/s, 1 degree/s is 131. 4 degrees
  // above 21 are 1335.
  EXPECT_EQ(read(0x69, {0x2D}, 14),
            (Bytes{0xC0, 0x00, 0x20, 0x00, 0x7F, 0xFF, 0x33, 0x2C, 0x80, 0x12, 0, 0, 0x05, 0x37}));
  write(0x69, {0x7F, 0x20});
  EXPECT_EQ(read(0x69, {0x14}, 1), Bytes{0x01});
  write(0x69, {0x14, 0x07});  // 16 g
  EXPECT_EQ(read(0x69, {0x2D}, 2), (Bytes{0, 0})) << "a register of that bank";
  write(0x69, {0x7F, 0x00});
  EXPECT_EQ(read(0x69, {0x2D}, 2), (Bytes{0xF8, 0x00}));
  write(0x69, {0x06, 0x80});
  EXPECT_EQ(read(0x69, {0x06}, 1), Bytes{0x41}) << "after the reset";
}

TEST_F(OptionalDeviceModels, Bno055IsSilentUntilItLeavesConfigmode) {
  EXPECT_EQ(read(0x28, {0x00}, 4), (Bytes{0xA0, 0xFB, 0x32, 0x0F}));
  EXPECT_EQ(read(0x28, {0x08}, 6), Bytes(6));
  write(0x28, {0x3B, 0x02});
  write(0x28, {0x3D, 0x0C});
  EXPECT_EQ(read(0x28, {0x08}, 6), (Bytes{0, 0, 0, 0, 0xD5, 0x03})) << "981 is 9.81 m/s2";
  write(0x28, {0x3B, 0x00});
  EXPECT_EQ(read(0x28, {0x3B}, 1), Bytes{0x02}) << "the device is not in CONFIGMODE";
  Bno055Model::Motion motion;
  motion.mrad_per_s[2] = -1000;
  devices.bno055.feel(motion);
  EXPECT_EQ(read(0x28, {0x18}, 2), (Bytes{0x7C, 0xFC})) << "-900 is -1 rad/s";
  EXPECT_EQ(read(0x28, {0x34}, 2), (Bytes{25, 0xFF}));
  write(0x28, {0x07, 0x01});
  EXPECT_EQ(read(0x28, {0x00}, 1), Bytes{0x00}) << "page 1";
}

TEST_F(OptionalDeviceModels, Bno055TakesItsTimeToChangeItsMode) {
  write(0x28, {0x3D, 0x0C});
  // A write takes effect when it ends, here 10 ms later. So the test changes the mode again.
  write(0x28, {0x3D, 0x00});
  std::uint8_t mode[] = {0x3D, 0x0C};
  firmware::UserTransfer transfer;
  transfer.address = 0x28;
  transfer.out = mode;
  transfer.out_size = sizeof mode;
  write(0x28, {0x3F, 0x20});  // a reset also resets the mode
  bus.begin(transfer);
  bus.advance(1000);
  EXPECT_EQ(read(0x28, {0x08}, 6), Bytes(6)) << "1 ms";
  EXPECT_EQ(read(0x28, {0x0C}, 2), (Bytes{0xD5, 0x03})) << "11 ms";
}

TEST_F(OptionalDeviceModels, Vl53l0xMeasuresEvery33MillisecondsOnceStarted) {
  EXPECT_EQ(read(0x29, {0xC0}, 3), (Bytes{0xEE, 0xAA, 0x10}));
  EXPECT_EQ(read(0x29, {0x14}, 12), Bytes(12));
  write(0x29, {0x00, 0x02});
  EXPECT_EQ(read(0x29, {0x1E}, 2), Bytes(2)) << "too early";
  bus.advance(33'000);
  EXPECT_EQ(read(0x29, {0x1E}, 2), (Bytes{0x01, 0xF4}));
  EXPECT_EQ(read(0x29, {0x14}, 1), Bytes{11 << 3});
  devices.vl53l0x.see(Vl53l0xModel::no_target);
  bus.advance(33'000);
  EXPECT_EQ(read(0x29, {0x1E}, 2), (Bytes{0x1F, 0xFE}));
  EXPECT_EQ(read(0x29, {0x14}, 1), Bytes{4 << 3});
}

TEST_F(OptionalDeviceModels, As5600RepeatsAnAngleAndCountsFromItsZero) {
  devices.as5600.turn(3072);
  EXPECT_EQ(read(0x36, {0x0C}, 4), (Bytes{0x0C, 0x00, 0x0C, 0x00}))
      << "the pointer returns to the angle";
  write(0x36, {0x01, 0x08, 0x00});  // ZPOS
  EXPECT_EQ(read(0x36, {0x0E}, 2), (Bytes{0x04, 0x00}));
  EXPECT_EQ(read(0x36, {0x0B}, 1), Bytes{0x20});
  devices.as5600.set_magnet(As5600Model::Magnet::too_weak);
  EXPECT_EQ(read(0x36, {0x0B}, 1), Bytes{0x30});
  devices.as5600.set_magnet(As5600Model::Magnet::missing);
  EXPECT_EQ(read(0x36, {0x0B}, 1), Bytes{0x10});
}

}  // namespace
}  // namespace r4::sim
