// SPDX-License-Identifier: GPL-3.0-or-later
// The text of a device description, and the errors of an invalid description.
#include "r4link/devices/description.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <string_view>

#include "r4link/devices/device.hpp"
#include "r4link/error.hpp"
#include "tests/support/problems.hpp"

namespace r4 {
namespace {

using namespace std::chrono_literals;
using Bytes = std::vector<std::uint8_t>;

constexpr std::string_view thermometer = R"(# of mine
device thermo9   # the ninth
title  A thermometer, outdoors
address 0x48 73
check x0f xa55a
write x0180 wait 20
write x02
poll all x00 6 250
value temperature all 0 i16be bits 4..15 scale 1/16 offset -1 unit degC range -40 125
value pressure all 2 u24le scale 100*2/4 unit Pa
value turn all 5 i8 scale pi/180
)";

TEST(DeviceDescription, HasTheValuesOfItsLines) {
  const DeviceDescription device = DeviceDescription::parse(thermometer);
  EXPECT_EQ(device.name, "thermo9");
  EXPECT_EQ(device.title, "A thermometer, outdoors");
  EXPECT_EQ(device.role, DeviceRole::none);
  EXPECT_EQ(device.addresses, (std::vector<int>{0x48, 73}));
  ASSERT_EQ(device.checks.size(), 1U);
  EXPECT_EQ(device.checks[0].register_bytes, Bytes{0x0F});
  EXPECT_EQ(device.checks[0].expected, (Bytes{0xA5, 0x5A}));
  ASSERT_EQ(device.writes.size(), 2U);
  EXPECT_EQ(device.writes[0].bytes, (Bytes{0x01, 0x80}));
  EXPECT_EQ(device.writes[0].wait, 20ms);
  EXPECT_EQ(device.writes[1].wait, 0ms);
  ASSERT_EQ(device.polls.size(), 1U);
  EXPECT_EQ(device.polls[0].count, 6);
  EXPECT_EQ(device.polls[0].period, 250ms);
  ASSERT_EQ(device.values.size(), 3U);
  EXPECT_EQ(device.values[0].unit, "degC");
  EXPECT_EQ(device.find("pressure"), 1U);
  EXPECT_FALSE(device.find("pres"));
}

TEST(DeviceDescription, DecodesEachKindOfNumber) {
  const DeviceDescription device = DeviceDescription::parse(thermometer);
  const auto decode = [&](std::size_t value, const Bytes& bytes) {
    return device.values[value].decode(bytes.data(), bytes.size());
  };
  EXPECT_EQ(decode(0, {0x19, 0x1F, 0, 0, 0, 0}), 24.0625) << "the lowest four bits do not count";
  EXPECT_EQ(decode(0, {0xFF, 0xF0, 0, 0, 0, 0}), -1.0625);
  EXPECT_FALSE(decode(0, {0x7F, 0xFF, 0, 0, 0, 0})) << "126.9 is outside of the range";
  EXPECT_FALSE(decode(0, {0x80, 0x00, 0, 0, 0, 0})) << "-129 is outside of the range";
  EXPECT_EQ(decode(1, {0, 0, 0x01, 0x02, 0x83, 0}), 0x830201 * 50.0);
  EXPECT_NEAR(*decode(2, {0, 0, 0, 0, 0, 0xA6}), -M_PI / 2, 1e-12);
  EXPECT_FALSE(decode(2, {0, 0, 0, 0, 0}).has_value()) << "the byte of this value is missing";
}

void put_reading(State& state, int slot, const Bytes& bytes, std::uint32_t t_ms = 0) {
  I2cReading& reading = state.raw.i2c[slot - 1];
  reading.data.size = static_cast<std::uint8_t>(bytes.size());
  std::copy(bytes.begin(), bytes.end(), reading.data.bytes);
  reading.t_ms = t_ms;
}

TEST(Device, HasNoMeasurementOfAnInvalidValue) {
  const Device lidar(DeviceDescription::load("vl53l0x"), 0x29);
  State state;
  const std::size_t distance = lidar.description().find("distance").value();
  put_reading(state, 1, {11 << 3, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x01, 0x2C});  // 300 mm, valid
  EXPECT_TRUE(lidar.counts(state, distance));
  EXPECT_DOUBLE_EQ(lidar.reading(state, distance).number.value(), 0.3);
  put_reading(state, 1, {2 << 3, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x01, 0x2C});
  EXPECT_FALSE(lidar.counts(state, distance));
  EXPECT_FALSE(lidar.reading(state, distance).number);
  EXPECT_EQ(lidar.reading(state, "status").number, 2);
}

constexpr std::string_view gauge =
    "device gauge\naddress 0x48\n"
    "check x00 x01\n"
    "lookalike x00 x02 a gauge of another maker, 5 V\n"
    "write x0901\n"
    "poll all x00 1 20\npoll modes x09 2 20\n"
    "value height all 0 u8\n"
    "value mode modes 0 u8\n"
    "value status modes 1 u8 range 1 9\n"
    "ready mode 1\n"
    "ready status\n";

TEST(Device, HasNoMeasurementUntilItIsSetUp) {
  const Device device(DeviceDescription::parse(gauge), 0x48);
  State state;
  put_reading(state, 1, {0});
  EXPECT_FALSE(device.is_set_up(state).has_value()) << "the modes were not read yet";
  EXPECT_FALSE(device.reading(state, "height").number);
  const auto set_up_with = [&](std::uint8_t mode, std::uint8_t status) {
    put_reading(state, 2, {mode, status});
    return device.is_set_up(state).value();
  };
  EXPECT_FALSE(set_up_with(0, 5));
  EXPECT_FALSE(device.reading(state, "height").number);
  EXPECT_EQ(device.reading(state, "mode").number, 0)
      << "the value that shows the setup is still reported";
  EXPECT_FALSE(set_up_with(1, 0));
  EXPECT_FALSE(device.reading(state, "height").number);
  EXPECT_TRUE(set_up_with(1, 5));
  EXPECT_EQ(device.reading(state, "height").number, 0);
}

TEST(Device, AShippedDeviceWithWritesReportsThatItIsSetUp) {
  for (const std::string& name : DeviceDescription::shipped()) {
    const DeviceDescription device = DeviceDescription::load(name);
    EXPECT_EQ(device.ready.empty(), device.writes.empty()) << name;
  }
}

std::string what_is_there(const Device& device, std::vector<std::uint8_t> identity) {
  CommandResult result;
  result.outcome = Outcome::refused;
  result.step = 1;
  result.transfer.pnum = 1;
  result.transfer.outcome = I2cOutcome::done;
  result.transfer.data.size = static_cast<std::uint8_t>(identity.size());
  std::copy(identity.begin(), identity.end(), result.transfer.data.bytes);
  const Problem problem = explain(device, result, LinkStatus());
  return problem.reason + "; " + problem.fix;
}

TEST(Device, NamesASubstituteChipAndAdvises) {
  const std::string clone = what_is_there(Device::from("mpu6050@0x68"), {0x70});
  EXPECT_EQ(clone.substr(0, clone.find(';')),
            "this is an MPU-6500, which has another scale of its temperature: its register x75 has "
            "x70, not x68");
  EXPECT_NE(clone.find("write check x75 x70"), std::string::npos) << clone;
  for (const int identity : {0x71, 0x72, 0x98}) {
    const std::string other =
        what_is_there(Device::from("mpu6050@0x68"), {static_cast<std::uint8_t>(identity)});
    EXPECT_NE(other.find("write check"), std::string::npos) << other;
  }
  EXPECT_EQ(what_is_there(Device::from("mpu6050@0x68"), {0x00}).substr(0, 22),
            "this is another device");
}

TEST(Device, ComparesAScaledConditionAsWritten) {
  const Device device(DeviceDescription::parse("device t\ntitle t\naddress 0x40\npoll s x00 2 100\n"
                                               "value mode s 0 u8 scale 0.1\n"
                                               "value x s 1 u8 only mode 0.3\n"),
                      0x40);
  State state;
  put_reading(state, 1, {3, 9});
  EXPECT_EQ(device.reading(state, "x").number, 9) << "3 times 0.1 is not quite 0.3";
  put_reading(state, 1, {4, 9});
  EXPECT_FALSE(device.reading(state, "x").number);
}

TEST(Device, ReplacesADeviceWithItsAddressOrSlot) {
  const Device ina = Device::from("ina219@0x40:1");  // uses slots 1 and 2
  EXPECT_TRUE(ina.takes_place_of(Device::from("ina219@0x40:5")));
  EXPECT_TRUE(ina.takes_place_of(Device::from("ina219@0x41:2")));
  EXPECT_FALSE(ina.takes_place_of(Device::from("ina219@0x41:3")));
}

TEST(Device, AnEncoderWithoutItsMagnetHasNoAngle) {
  const Device encoder(DeviceDescription::load("as5600"), 0x36);
  State state;
  put_reading(state, 1, {0, 0});
  EXPECT_FALSE(encoder.reading(state, "angle").number) << "the status was not read yet";
  put_reading(state, 2, {0x20});
  EXPECT_EQ(encoder.reading(state, "angle").number, 0);
  put_reading(state, 2, {0x10});
  EXPECT_FALSE(encoder.reading(state, "angle").number);
}

TEST(DeviceDescription, DecodesNumbersOfEveryWidthAndByteOrder) {
  struct Case {
    const char* type;
    double number;
  };
  const Bytes bytes{0x81, 0x02, 0x03, 0x84};
  for (const Case& each :
       {Case{"u8", 0x81}, Case{"i8", -0x7F}, Case{"u16be", 0x8102}, Case{"u16le", 0x0281},
        Case{"i16be", 0x8102 - 0x10000}, Case{"i16le", 0x0281}, Case{"u24be", 0x810203},
        Case{"i24be", 0x810203 - 0x1000000}, Case{"i24le", 0x030281}, Case{"u32le", 0x84030281},
        Case{"i32be", 0x81020384 - 4294967296.0}, Case{"i32le", 0x84030281 - 4294967296.0},
        Case{"u32be bits 31..31", 1}, Case{"i32be bits 31..31", -1}, Case{"u8 bits 0..0", 1}}) {
    const auto device = DeviceDescription::parse(
        std::string("device a\naddress 8\npoll p x00 4 5\nvalue v p 0 ") + each.type);
    EXPECT_EQ(device.values[0].decode(bytes.data(), bytes.size()), each.number) << each.type;
  }
}

struct WrongText {
  int line;  // 0: no line number
  std::string text;
  const char* problem;
};

void expect_problem(const WrongText& wrong, const std::string& before = "") {
  const Problem problem =
      test::problem_of([&] { DeviceDescription::parse(before + wrong.text, "mine.device"); });
  const std::string line = wrong.line == 0 ? "" : ", line " + std::to_string(wrong.line);
  EXPECT_EQ(problem.kind, ErrorKind::data);
  EXPECT_FALSE(problem.fix.empty());
  EXPECT_EQ(problem.thing + ": " + problem.reason, "mine.device" + line + ": " + wrong.problem);
}

const std::string description_head = "device a\naddress 0x28\npoll p x08 6 20\n";

TEST(DeviceDescription, ReportsTheErrorInALine) {
  for (const WrongText& each : {
           WrongText{4, "device b\n", "the device has a name already"},
           WrongText{4, "check x000000 x00\n", "a register has 3 bytes"},
           WrongText{4, "check x00 x\n", "the expected value has 0 bytes"},
           WrongText{4, "check x00 x0\n", "the expected value is not in the form of bytes"},
           WrongText{4, "write 3d00\n", "the written value is not in the form of bytes"},
           WrongText{4, "write x" + std::string(66, '0') + "\n", "the written value has 33 bytes"},
           WrongText{4, "write x3d00 wait 5001\n", "the wait in ms is out of range"},
           WrongText{4, "write x3d00 then 5\n", "the line does not have the form of its word"},
           WrongText{4, "poll q x00 33 20\n", "the count of bytes is out of range"},
           WrongText{4, "poll q x00 3 4\n", "the period in ms is out of range"},
           WrongText{4, "poll p x00 3 5\n", "a poll has this name already"},
           WrongText{4, "value v q 0 u8\n", "a poll of this name is not defined above"},
           WrongText{4, "value v p 5 u16be\n", "the value ends after the 6 bytes of its poll"},
           WrongText{4, "value v p 0 u16\n", "this is not a valid type"},
           WrongText{4, "value v p 0 u8be\n", "this is not a valid type"},
           WrongText{4, "value v p 0 u40be\n", "this is not a valid type"},
           WrongText{4, "value v p 0 u8 bits 0..8\n", "the highest bit is out of range"},
           WrongText{4, "value v p 0 u8 bits 5..3\n", "the highest bit is out of range"},
           WrongText{4, "value v p 0 u8 bits 5\n", "the highest bit is not a number"},
           WrongText{4, "value v p 0 u8 scale 0\n", "the scale is 0"},
           WrongText{4, "value v p 0 u8 scale 1/0\n", "the scale is not a number"},
           WrongText{4, "value v p 0 u8 scale nan\n", "the scale is not a number"},
           WrongText{4, "value v p 0 u8 offset 1/inf\n", "the offset is not a number"},
           WrongText{4, "value v p 0 u8 scale 1e-31\n", "the scale is out of range"},
           WrongText{4, "value v p 0 u8 range 0 1e300\n", "the range is out of range"},
           WrongText{4, "value v p 0 u8 only w 1\nvalue w p 0 u8\n",
                     "a value of this name is not defined above"},
           WrongText{4, "value v p 0 u8 scale\n", "a word is missing at the end of the line"},
           WrongText{4, "value v p 0 u8 unit a,b\n", "this is not a valid unit"},
           WrongText{4, "value v p 0 u8 range 1 1\n", "the range is empty"},
           WrongText{4, "value v p 0 u8 unit V unit V\n", "a word is named twice"},
           WrongText{4, "value v p 0 u8 gain 3\n", "a word of the value is not known"},
           WrongText{4, "ready v 1\n", "a value of this name is not defined above"},
           WrongText{4, "lookalike x00 x01\n", "the line has 3 words"},
           WrongText{4,
                     "lookalike x00 x01 a\x1b"
                     "b\n",
                     "the title is too long, or not plain text"},
       }) {
    expect_problem(each, description_head);
  }
}

TEST(DeviceDescription, ReportsAnErrorWithItsLineNumber) {
  std::string nine = description_head;
  for (int i = 0; i < 8; ++i) nine += "poll p" + std::to_string(i) + " x00 1 20\n";
  std::string many = description_head;
  for (int i = 0; i < 257; ++i) many += "value v" + std::to_string(i) + " p 0 u8\n";
  for (const WrongText& each : {
           WrongText{0, "", "the description is empty"},
           WrongText{1, "title x\n", "the description does not begin with its name"},
           WrongText{1, "device A\n", "this is not a valid name"},
           WrongText{6, description_head + "\n\nregister x00\n",
                     "\"register\" is not a valid word"},
           WrongText{2, "device a\naddress 7\n", "an address is out of range"},
           WrongText{2, "device a\naddress 0x78\n", "an address is out of range"},
           WrongText{2, "device a\naddress 9 9\n", "an address is named twice"},
           WrongText{2, "device a\naddress x28\n", "an address is not a number"},
           WrongText{2, "device a\nrole car\n", "this is not a valid role"},
           WrongText{3, "device a\nrole imu\nrole imu\n", "the device has a role already"},
           WrongText{3, "device a\ntitle b\ntitle c\n", "the device has a title already"},
           WrongText{11, nine, "the board repeats at most 8 readings"},
           WrongText{5, description_head + "value w p 0 u8\nvalue v p 0 u8 only w\n",
                     "a word is missing at the end of the line"},
           WrongText{5, description_head + "value v p 0 u8\nready v 1 2\n", "the line has 4 words"},
           WrongText{5, description_head + "value v p 0 u8\nready v x01\n",
                     "the number after ready is not a number"},
           WrongText{5, description_head + "value v p 0 u8\nvalue v p 1 u8\n",
                     "a value has this name already"},
           WrongText{260, many, "the description has more than 256 values"},
           WrongText{0, description_head, "the device has no value"},
           WrongText{0, "device a\npoll p x 1 5\nvalue v p 0 u8\n", "the device has no address"},
           WrongText{0, "device a\naddress 8\n", "the device has no poll"},
           WrongText{0, description_head + "role angle\nvalue angle p 0 u8 unit deg\n",
                     "the role angle needs a value angle in rad"},
           WrongText{0, description_head + "role range\nvalue distance p 0 u8 unit m\n",
                     "the value distance has no range"},
           WrongText{1, std::string(500, 'a'), "the line has more than 400 characters"},
           WrongText{0, std::string(70000, '\n'), "the file has more than 65536 bytes"},
       }) {
    expect_problem(each);
  }
}

TEST(DeviceDescription, AShippedDescriptionHasTheNameOfItsFileAndARole) {
  const std::vector<std::string> names = DeviceDescription::shipped();
  EXPECT_EQ(names, (std::vector<std::string>{"as5600", "bno055", "icm20948", "ina219", "mpu6050",
                                             "vl53l0x"}));
  for (const std::string& name : names) {
    const DeviceDescription device = DeviceDescription::load(name);
    EXPECT_EQ(device.name, name);
    EXPECT_NE(device.role, DeviceRole::none) << name;
    EXPECT_FALSE(device.title.empty()) << name;
  }
}

TEST(DeviceDescription, AnUnknownNameIsAnErrorThatListsTheShippedOnes) {
  const auto problem = [](const char* name) {
    return test::problem_of([&] { DeviceDescription::load(name); });
  };
  EXPECT_EQ(problem("bno056").kind, ErrorKind::usage);
  EXPECT_TRUE(test::contains(problem("bno056").fix, "bno055"));
  EXPECT_EQ(problem("/nonexistent/mine.device").kind, ErrorKind::open);
  problem("/dev/zero");  // endless
  problem("/tmp/");
}

std::string usage_of(const std::vector<std::string>& texts) {
  const Problem problem = test::problem_of([&] { Device::from(texts); });
  EXPECT_EQ(problem.kind, ErrorKind::usage);
  return problem.thing + ": " + problem.reason;
}

TEST(Device, IsNamedWithItsAddressAndSlot) {
  const Device imu = Device::from("bno055");
  EXPECT_EQ(imu.text(), "bno055@0x28");
  EXPECT_EQ(imu.fields(), "I2C1,I2C2");
  EXPECT_EQ(Device::from("bno055@41:7").text(), "bno055@0x29");
  EXPECT_EQ(Device::from("bno055@0x29:7").fields(), "I2C7,I2C8");
  const auto devices = Device::from({"mpu6050", "ina219@0x41", "as5600@0x36:5", "bno055@0x28:7"});
  EXPECT_EQ(devices[1].fields(), "I2C3,I2C4");
  EXPECT_EQ(usage_of({"bno055@0x28:8"}),
            "bno055@0x28: the device needs 2 slots from slot 8 on, and the board has 8 slots");
  EXPECT_EQ(usage_of({"bno055@0x28:0"}),
            "bno055@0x28: the device needs 2 slots from slot 0 on, and the board has 8 slots");
  EXPECT_EQ(usage_of({"bno055@0x30"}), "bno055@0x30: the device cannot have this address");
  EXPECT_EQ(usage_of({"bno055@"}), "bno055@: the address or slot is not a number");
  EXPECT_EQ(usage_of({"bno055@0x28:"}), "bno055@0x28:: the address or slot is not a number");
  EXPECT_EQ(usage_of({"mpu6050@0x68:2", "bno055@0x28:1"}),
            "bno055@0x28: mpu6050@0x68 also has slot 2");
  EXPECT_EQ(usage_of({"mpu6050@0x68", "icm20948@0x68"}),
            "icm20948@0x68: mpu6050@0x68 has the same address");
  EXPECT_THROW(Device::from("ina219", std::numeric_limits<int>::max()), Error);
}

TEST(Device, DecodesTheSlotsOfAState) {
  const Device power = Device::from("ina219@0x40:3");
  State state;
  EXPECT_FALSE(power.reading(state, "voltage").number) << "nothing was read yet";
  // TI SBOS448G, 8.5.1: 11.98 V, 20 mV over the shunt.
  put_reading(state, 3, {0x07, 0xD0}, 1000);
  put_reading(state, 4, {0x5D, 0x98}, 1002);
  const DeviceReading voltage = power.reading(state, "voltage");
  EXPECT_DOUBLE_EQ(voltage.number.value(), 11.98);
  EXPECT_EQ(voltage.t_ms, 1002U);
  EXPECT_DOUBLE_EQ(power.reading(state, "current").number.value(), 0.2);
  EXPECT_EQ(power.readings(state).size(), power.description().values.size());
  put_reading(state, 3, {0x07}, 1000);
  EXPECT_FALSE(power.reading(state, "current").number) << "the reading is of another device";
  EXPECT_THROW(power.reading(state, "amps"), Error);
}

}  // namespace
}  // namespace r4
