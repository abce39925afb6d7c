// SPDX-License-Identifier: GPL-3.0-or-later
// r4::DeviceDescription: what the bytes of a device on the user's I2C bus mean, from a small text file
// (docs/described-devices.md has its words).
//
//     const auto imu = r4::DeviceDescription::load("mpu6050");   // shipped; or a path: "./mine.device"
//     imu.values[0].decode(bytes, count);                        // "accel_x", m/s2
//
// At an address of a board it is a Device (device.hpp).
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "../config.hpp"

namespace r4 {

// What the device is for a robot, and with that, which values it must have, in which unit:
//
//     imu     accel_x, accel_y, accel_z in m/s2; gyro_x, gyro_y, gyro_z in rad/s; all or none of quat_w, quat_x,
//             quat_y, quat_z, without a unit
//     power   voltage in V, current in A
//     range   distance in m, with its range
//     angle   angle in rad
enum class DeviceRole : std::uint8_t { none, imu, power, range, angle };
// "none", "imu" …
R4LINK_API const char* to_text(DeviceRole role);

// Read and compared before anything is written: is it this device?
struct DeviceCheck {
  std::vector<std::uint8_t> register_bytes;  // 0 to 2
  std::vector<std::uint8_t> expected;        // 1 to 32
};

// Another device that people take for this one: what its register has instead of what a DeviceCheck
// expects.
struct DeviceLookalike {
  std::vector<std::uint8_t> register_bytes;  // 0 to 2
  std::vector<std::uint8_t> found;           // 1 to 32
  std::string title;                         // what it is, for people
};

struct DeviceWrite {
  std::vector<std::uint8_t> bytes;    // 1 to 32: the register, and what it is to hold
  std::chrono::milliseconds wait{0};  // afterwards, up to 5 s
};

// What the board reads by itself, again and again; each takes one of its eight slots.
struct DevicePoll {
  std::string name;
  std::vector<std::uint8_t> register_bytes;  // 0 to 2
  int count = 0;                             // bytes, 1 to 32
  std::chrono::milliseconds period{0};       // 5 to 60000
};

// A number in what a poll has read.
struct R4LINK_API DeviceValue {
  std::string name;
  std::size_t poll = 0;  // in DeviceDescription::polls
  int at = 0;            // its first byte
  int size = 1;          // bytes, 1 to 4
  bool is_signed = false;
  bool big_endian = false;
  int low_bit =
      0;  // those of its bits that count, of which the highest of a signed one is the sign
  int high_bit = 7;
  double scale = 1;   // what is read, times this,
  double offset = 0;  // and this added, is in `unit`
  std::string unit;   // empty: none
  // What is beyond these is no measurement: a sensor says so that it has none.
  double minimum = -std::numeric_limits<double>::infinity();
  double maximum = std::numeric_limits<double>::infinity();
  // It is none either where another value of the device, above it, is not this number.
  struct Only {
    std::size_t value = 0;  // in DeviceDescription::values
    double number = 0;
  };
  std::optional<Only> only;

  // Of the bytes of its poll. Nothing if there are too few, or if it is beyond its range; `only` is not looked at, see
  // Device::reading().
  std::optional<double> decode(const std::uint8_t* bytes, std::size_t count) const;
};

// How the device tells that it is still as it was set up: `value` is a measurement and, where
// `number` is there, is that number. A device that was reset fails this.
struct DeviceReady {
  std::size_t value = 0;  // in DeviceDescription::values
  std::optional<double> number;
};

struct R4LINK_API DeviceDescription {
  std::string name;
  std::string title;
  DeviceRole role = DeviceRole::none;
  std::vector<int> addresses;  // that it can have; the first is the usual one
  std::vector<DeviceCheck> checks;
  std::vector<DeviceLookalike> lookalikes;
  std::vector<DeviceWrite> writes;
  std::vector<DevicePoll> polls;  // 1 to 8
  std::vector<DeviceValue> values;
  std::vector<DeviceReady> ready;  // all of them hold while it is set up; empty: it does not tell
  std::string text;                // that all this was read from

  static constexpr std::size_t max_text = 65536;  // bytes of a description
  static constexpr std::size_t max_lines = 256;   // lines of each kind

  // The place of a value; nothing if there is none of that name.
  std::optional<std::size_t> find(std::string_view value) const;

  // Throws Error{data} that names the line; `source` is what it calls the text.
  static DeviceDescription parse(std::string_view text, const std::string& source = "description");
  // One that is shipped, by its name, or a file: what has a '/' or ends in ".device". Throws Error{usage} for a name
  // that is not shipped, Error{open} or {permission} for a file that cannot be read, and as parse() does.
  static DeviceDescription load(const std::string& name_or_path);
  // The names of those that are shipped, and the text of one of them; throws Error{usage} as load() does.
  static std::vector<std::string> shipped();
  static std::string_view text_of(const std::string& name);
};

}  // namespace r4
