// SPDX-License-Identifier: GPL-3.0-or-later
// The text of a device description: what it says, and what is said of one that is wrong.
#include "r4link/devices/description.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <string_view>

#include "r4link/devices/device.hpp"
#include "r4link/error.hpp"

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

TEST(DeviceDescription, SaysWhatItsLinesSay) {
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
  EXPECT_EQ(decode(0, {0x19, 0x1F, 0, 0, 0, 0}), 24.0625) << "the four bits below do not count";
  EXPECT_EQ(decode(0, {0xFF, 0xF0, 0, 0, 0, 0}), -1.0625);
  EXPECT_FALSE(decode(0, {0x7F, 0xFF, 0, 0, 0, 0})) << "126.9 is beyond its range";
  EXPECT_FALSE(decode(0, {0x80, 0x00, 0, 0, 0, 0})) << "so is -129";
  EXPECT_EQ(decode(1, {0, 0, 0x01, 0x02, 0x83, 0}), 0x830201 * 50.0);
  EXPECT_NEAR(*decode(2, {0, 0, 0, 0, 0, 0xA6}), -M_PI / 2, 1e-12);
  EXPECT_FALSE(decode(2, {0, 0, 0, 0, 0}).has_value()) << "its byte is missing";
}

TEST(Device, AValueThatTheDeviceDoesNotCountIsNoMeasurement) {
  const Device lidar(DeviceDescription::load("vl53l0x"), 0x29);
  State state;
  I2cReading& read = state.i2c[0];
  read.data.size = 12;
  read.data.bytes[10] = 0x01;  // 300 mm
  read.data.bytes[11] = 0x2C;
  const std::size_t distance = lidar.description().find("distance").value();
  read.data.bytes[0] = 11 << 3;  // the range is valid
  EXPECT_TRUE(lidar.counts(state, distance));
  EXPECT_DOUBLE_EQ(lidar.reading(state, distance).number.value(), 0.3);
  read.data.bytes[0] = 2 << 3;
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

TEST(Device, OfOneThatIsNotSetUpNothingIsAMeasurement) {
  const Device device(DeviceDescription::parse(gauge), 0x48);
  State state;
  state.i2c[0].data.size = 1;
  state.i2c[0].data.bytes[0] = 0;
  EXPECT_FALSE(device.is_set_up(state).has_value()) << "its modes were not read yet";
  EXPECT_FALSE(device.reading(state, "height").number);
  I2cReading& modes = state.i2c[1];
  modes.data.size = 2;
  const auto set_up_with = [&](std::uint8_t mode, std::uint8_t status) {
    modes.data.bytes[0] = mode;
    modes.data.bytes[1] = status;
    return device.is_set_up(state).value();
  };
  EXPECT_FALSE(set_up_with(0, 5));
  EXPECT_FALSE(device.reading(state, "height").number);
  EXPECT_EQ(device.reading(state, "mode").number, 0) << "what tells it is still told";
  EXPECT_FALSE(set_up_with(1, 0));
  EXPECT_FALSE(device.reading(state, "height").number);
  EXPECT_TRUE(set_up_with(1, 5));
  EXPECT_EQ(device.reading(state, "height").number, 0);
}

TEST(Device, EachThatIsShippedTellsWhetherItIsSetUpUnlessNothingIsWrittenToIt) {
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

TEST(Device, AChipThatIsSoldInItsPlaceIsNamedWithWhatToDo) {
  const std::string clone = what_is_there(Device::from("mpu6050@0x68"), {0x70});
  EXPECT_EQ(clone.substr(0, clone.find(';')),
            "it is an MPU-6500, which has another scale of its temperature: its register x75 has "
            "x70, not x68");
  EXPECT_NE(clone.find("let the copy check x75 x70"), std::string::npos) << clone;
  for (const int identity : {0x71, 0x72, 0x98}) {
    const std::string other =
        what_is_there(Device::from("mpu6050@0x68"), {static_cast<std::uint8_t>(identity)});
    EXPECT_NE(other.find("let the copy check"), std::string::npos) << other;
  }
  EXPECT_EQ(what_is_there(Device::from("mpu6050@0x68"), {0x00}).substr(0, 20),
            "it is another device");
}

TEST(Device, CountsByAScaledValueAsItIsWritten) {
  const Device device(DeviceDescription::parse("device t\ntitle t\naddress 0x40\npoll s x00 2 100\n"
                                               "value mode s 0 u8 scale 0.1\n"
                                               "value x s 1 u8 only mode 0.3\n"),
                      0x40);
  State state;
  state.i2c[0].data.size = 2;
  state.i2c[0].data.bytes[0] = 3;
  state.i2c[0].data.bytes[1] = 9;
  EXPECT_EQ(device.reading(state, "x").number, 9) << "3 times 0.1 is not quite 0.3";
  state.i2c[0].data.bytes[0] = 4;
  EXPECT_FALSE(device.reading(state, "x").number);
}

TEST(Device, TakesThePlaceOfWhatHasItsAddressOrASlotOfIt) {
  const Device ina = Device::from("ina219@0x40:1");  // slots 1 and 2
  EXPECT_TRUE(ina.takes_place_of(Device::from("ina219@0x40:5")));
  EXPECT_TRUE(ina.takes_place_of(Device::from("ina219@0x41:2")));
  EXPECT_FALSE(ina.takes_place_of(Device::from("ina219@0x41:3")));
}

TEST(Device, WithoutItsMagnetAnEncoderHasNoAngle) {
  const Device encoder(DeviceDescription::load("as5600"), 0x36);
  State state;
  state.i2c[0].data.size = 2;
  state.i2c[0].data.bytes[0] = state.i2c[0].data.bytes[1] = 0;
  EXPECT_FALSE(encoder.reading(state, "angle").number) << "its status was not read yet";
  state.i2c[1].data.size = 1;
  state.i2c[1].data.bytes[0] = 0x20;
  EXPECT_EQ(encoder.reading(state, "angle").number, 0);
  state.i2c[1].data.bytes[0] = 0x10;
  EXPECT_FALSE(encoder.reading(state, "angle").number);
}

TEST(DeviceDescription, TakesNumbersOfEveryWidthAndOrder) {
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

std::string problem_of(const std::string& text) {
  try {
    DeviceDescription::parse(text, "mine.device");
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::data);
    EXPECT_FALSE(error.problem().fix.empty());
    return error.problem().thing + ": " + error.problem().reason;
  }
  return "nothing";
}

TEST(DeviceDescription, SaysWhatIsWrongAndInWhichLine) {
  const std::string head = "device a\naddress 0x28\npoll p x08 6 20\n";
  struct Case {
    std::string text;
    const char* problem;
  };
  std::string nine = head;
  for (int i = 0; i < 8; ++i) nine += "poll p" + std::to_string(i) + " x00 1 20\n";
  std::string many = head;
  for (int i = 0; i < 257; ++i) many += "value v" + std::to_string(i) + " p 0 u8\n";
  for (const Case& each : {
           Case{"", "mine.device: it is empty"},
           Case{"title x\n", "mine.device, line 1: it does not begin with its name"},
           Case{"device A\n", "mine.device, line 1: that is no name"},
           Case{head + "device b\n", "mine.device, line 4: it has a name already"},
           Case{head + "\n\nregister x00\n",
                "mine.device, line 6: \"register\" is none of its words"},
           Case{"device a\naddress 7\n", "mine.device, line 2: an address is out of range"},
           Case{"device a\naddress 0x78\n", "mine.device, line 2: an address is out of range"},
           Case{"device a\naddress 9 9\n", "mine.device, line 2: an address is there twice"},
           Case{"device a\naddress x28\n", "mine.device, line 2: an address is no number"},
           Case{"device a\nrole car\n", "mine.device, line 2: there is no such role"},
           Case{"device a\nrole imu\nrole imu\n", "mine.device, line 3: it has a role already"},
           Case{"device a\ntitle b\ntitle c\n", "mine.device, line 3: it has a title already"},
           Case{head + "check x000000 x00\n", "mine.device, line 4: a register has 3 bytes"},
           Case{head + "check x00 x\n", "mine.device, line 4: what is expected has 0 bytes"},
           Case{head + "check x00 x0\n",
                "mine.device, line 4: what is expected is not written as bytes"},
           Case{head + "write 3d00\n",
                "mine.device, line 4: what is written is not written as bytes"},
           Case{head + "write x" + std::string(66, '0') + "\n",
                "mine.device, line 4: what is written has 33 bytes"},
           Case{head + "write x3d00 wait 5001\n",
                "mine.device, line 4: the wait in ms is out of range"},
           Case{head + "write x3d00 then 5\n", "mine.device, line 4: it has not its form"},
           Case{head + "poll q x00 33 20\n",
                "mine.device, line 4: the count of bytes is out of range"},
           Case{head + "poll q x00 3 4\n", "mine.device, line 4: the period in ms is out of range"},
           Case{head + "poll p x00 3 5\n", "mine.device, line 4: there is a poll of that name"},
           Case{nine, "mine.device, line 11: the board repeats 8 readings at most"},
           Case{head + "value v q 0 u8\n", "mine.device, line 4: no poll above has that name"},
           Case{head + "value v p 5 u16be\n",
                "mine.device, line 4: it ends behind the 6 bytes of its poll"},
           Case{head + "value v p 0 u16\n", "mine.device, line 4: there is no such type"},
           Case{head + "value v p 0 u8be\n", "mine.device, line 4: there is no such type"},
           Case{head + "value v p 0 u40be\n", "mine.device, line 4: there is no such type"},
           Case{head + "value v p 0 u8 bits 0..8\n",
                "mine.device, line 4: the highest bit is out of range"},
           Case{head + "value v p 0 u8 bits 5..3\n",
                "mine.device, line 4: the highest bit is out of range"},
           Case{head + "value v p 0 u8 bits 5\n",
                "mine.device, line 4: the highest bit is no number"},
           Case{head + "value v p 0 u8 scale 0\n", "mine.device, line 4: the scale is 0"},
           Case{head + "value v p 0 u8 scale 1/0\n", "mine.device, line 4: the scale is no number"},
           Case{head + "value v p 0 u8 scale nan\n", "mine.device, line 4: the scale is no number"},
           Case{head + "value v p 0 u8 offset 1/inf\n",
                "mine.device, line 4: the offset is no number"},
           Case{head + "value v p 0 u8 scale 1e-31\n",
                "mine.device, line 4: the scale is out of range"},
           Case{head + "value v p 0 u8 range 0 1e300\n",
                "mine.device, line 4: the range is out of range"},
           Case{head + "value v p 0 u8 only w 1\nvalue w p 0 u8\n",
                "mine.device, line 4: no value above has that name"},
           Case{head + "value w p 0 u8\nvalue v p 0 u8 only w\n",
                "mine.device, line 5: something is missing at its end"},
           Case{head + "value v p 0 u8 scale\n",
                "mine.device, line 4: something is missing at its end"},
           Case{head + "value v p 0 u8 unit a,b\n", "mine.device, line 4: that is no unit"},
           Case{head + "value v p 0 u8 range 1 1\n", "mine.device, line 4: the range is empty"},
           Case{head + "value v p 0 u8 unit V unit V\n",
                "mine.device, line 4: a word is there twice"},
           Case{head + "value v p 0 u8 gain 3\n",
                "mine.device, line 4: a word of the value is not known"},
           Case{head + "ready v 1\n", "mine.device, line 4: no value above has that name"},
           Case{head + "value v p 0 u8\nready v 1 2\n", "mine.device, line 5: it has 4 words"},
           Case{head + "value v p 0 u8\nready v x01\n",
                "mine.device, line 5: what that value is while it is set up is no number"},
           Case{head + "lookalike x00 x01\n", "mine.device, line 4: it has 3 words"},
           Case{head + "lookalike x00 x01 a\x1b" + "b\n",
                "mine.device, line 4: its title is too long, or not plain text"},
           Case{head + "value v p 0 u8\nvalue v p 1 u8\n",
                "mine.device, line 5: there is a value of that name"},
           Case{many, "mine.device, line 260: it has more than 256 values"},
           Case{head, "mine.device: it has no value"},
           Case{"device a\npoll p x 1 5\nvalue v p 0 u8\n", "mine.device: it has no address"},
           Case{"device a\naddress 8\n", "mine.device: nothing is read"},
           Case{head + "role angle\nvalue angle p 0 u8 unit deg\n",
                "mine.device: with the role angle it needs a value angle in rad"},
           Case{head + "role range\nvalue distance p 0 u8 unit m\n",
                "mine.device: its distance has no range"},
           Case{std::string(500, 'a'),
                "mine.device, line 1: the line has more than 400 characters"},
           Case{std::string(70000, '\n'), "mine.device: it has more than 65536 bytes"},
       }) {
    EXPECT_EQ(problem_of(each.text), each.problem);
  }
}

TEST(DeviceDescription, ThoseThatAreShippedAreNamedAsTheirFilesAndHaveARole) {
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

TEST(DeviceDescription, OneThatIsNotThereIsNamedWithThoseThatAre) {
  try {
    DeviceDescription::load("bno056");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::usage);
    EXPECT_NE(error.problem().fix.find("bno055"), std::string::npos);
  }
  try {
    DeviceDescription::load("/nonexistent/mine.device");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::open);
  }
  EXPECT_THROW(DeviceDescription::load("/dev/zero"), Error) << "endless";
  EXPECT_THROW(DeviceDescription::load("/tmp/"), Error);
}

std::string usage_of(const std::vector<std::string>& texts) {
  try {
    Device::from(texts);
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::usage);
    return error.problem().thing + ": " + error.problem().reason;
  }
  return "nothing";
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
            "bno055@0x28: it takes 2 slots from slot 8 on, and the board has 8");
  EXPECT_EQ(usage_of({"bno055@0x28:0"}),
            "bno055@0x28: it takes 2 slots from slot 0 on, and the board has 8");
  EXPECT_EQ(usage_of({"bno055@0x30"}), "bno055@0x30: it cannot have that address");
  EXPECT_EQ(usage_of({"bno055@"}), "bno055@: its address or slot is no number");
  EXPECT_EQ(usage_of({"bno055@0x28:"}), "bno055@0x28:: its address or slot is no number");
  EXPECT_EQ(usage_of({"mpu6050@0x68:2", "bno055@0x28:1"}),
            "bno055@0x28: mpu6050@0x68 has slot 2, too");
  EXPECT_EQ(usage_of({"mpu6050@0x68", "icm20948@0x68"}),
            "icm20948@0x68: mpu6050@0x68 has that address, too");
  EXPECT_THROW(Device::from("ina219", std::numeric_limits<int>::max()), Error);
}

TEST(Device, DecodesTheSlotsOfAState) {
  const Device power = Device::from("ina219@0x40:3");
  State state;
  const auto put = [&](int slot, const Bytes& bytes, std::uint32_t t_ms) {
    I2cReading& reading = state.i2c[slot - 1];
    reading.data.size = static_cast<std::uint8_t>(bytes.size());
    std::copy(bytes.begin(), bytes.end(), reading.data.bytes);
    reading.t_ms = t_ms;
  };
  EXPECT_FALSE(power.reading(state, "voltage").number) << "nothing was read yet";
  // TI SBOS448G, 8.5.1: 11.98 V, 20 mV over the shunt.
  put(3, {0x07, 0xD0}, 1000);
  put(4, {0x5D, 0x98}, 1002);
  const DeviceReading voltage = power.reading(state, "voltage");
  EXPECT_DOUBLE_EQ(voltage.number.value(), 11.98);
  EXPECT_EQ(voltage.t_ms, 1002U);
  EXPECT_DOUBLE_EQ(power.reading(state, "current").number.value(), 0.2);
  EXPECT_EQ(power.readings(state).size(), power.description().values.size());
  put(3, {0x07}, 1000);
  EXPECT_FALSE(power.reading(state, "current").number) << "somebody else's reading";
  EXPECT_THROW(power.reading(state, "amps"), Error);
}

}  // namespace
}  // namespace r4
