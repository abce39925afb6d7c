// SPDX-License-Identifier: GPL-3.0-or-later
// r4::DeviceDescription: an I2C device as a text file (docs/how-to/described-devices.md).
//     const auto imu = r4::DeviceDescription::load("mpu6050");   // shipped, or "./mine.device"
//     imu.values[0].decode(bytes, count);                        // "accel_x", m/s2
//
// A Device (device.hpp) is a description with an address on a board.
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

// The role of a device on a robot requires these values and units:
//     imu     accel_x, accel_y, accel_z in m/s2; gyro_x, gyro_y, gyro_z in rad/s; all or none of
//             quat_w, quat_x, quat_y, quat_z, without a unit
//     power   voltage in V, current in A
//     range   distance in m, with its range
//     angle   angle in rad
enum class DeviceRole : std::uint8_t { none, imu, power, range, angle };
R4LINK_API const char* to_text(DeviceRole role);

// A register that identifies the device. The board reads it before it writes to the device.
struct DeviceCheck {
  std::vector<std::uint8_t> register_bytes;  // 0 to 2
  std::vector<std::uint8_t> expected;        // 1 to 32
};

// A similar device, identified by the content of a register.
struct DeviceLookalike {
  std::vector<std::uint8_t> register_bytes;  // 0 to 2
  std::vector<std::uint8_t> found;           // 1 to 32
  std::string title;                         // the name of the similar device, for people
};

struct DeviceWrite {
  std::vector<std::uint8_t> bytes;    // 1 to 32: the register, and its new content
  std::chrono::milliseconds wait{0};  // after the write, up to 5 s
};

// A reading that the board repeats. Each reading takes one of the board's eight slots.
struct DevicePoll {
  std::string name;
  std::vector<std::uint8_t> register_bytes;  // 0 to 2
  int count = 0;                             // bytes, 1 to 32
  std::chrono::milliseconds period{0};       // 5 to 60000
};

struct R4LINK_API DeviceValue {
  std::string name;
  std::size_t poll = 0;  // index in DeviceDescription::polls
  int at = 0;            // index of the first byte
  int size = 1;          // bytes, 1 to 4
  bool is_signed = false;
  bool big_endian = false;
  int low_bit = 0;  // the lowest bit; the highest bit of a signed value is the sign
  int high_bit = 7;
  double scale = 1;   // the value in `unit` is the raw number times `scale` …
  double offset = 0;  // … plus `offset`
  std::string unit;   // may be empty
  // A value outside this range is not a measurement: the sensor has no measurement to report.
  double minimum = -std::numeric_limits<double>::infinity();
  double maximum = std::numeric_limits<double>::infinity();
  // The value is a measurement only while the earlier value `value` is equal to `number`.
  struct Only {
    std::size_t value = 0;  // index in DeviceDescription::values
    double number = 0;
  };
  std::optional<Only> only;

  // Decodes the bytes of the value's poll. Empty if there are too few bytes or the value is out of
  // range. Device::reading() checks `only`.
  std::optional<double> decode(const std::uint8_t* bytes, std::size_t count) const;
};

// True while the device is set up: `value` is a measurement, and equals `number` if given.
struct DeviceReady {
  std::size_t value = 0;  // index in DeviceDescription::values
  std::optional<double> number;
};

struct R4LINK_API DeviceDescription {
  std::string name;
  std::string title;
  DeviceRole role = DeviceRole::none;
  std::vector<int> addresses;  // possible addresses, the usual one first
  std::vector<DeviceCheck> checks;
  std::vector<DeviceLookalike> lookalikes;
  std::vector<DeviceWrite> writes;
  std::vector<DevicePoll> polls;  // 1 to 8
  std::vector<DeviceValue> values;
  // all are true while the device is set up; empty: the device cannot report its set-up
  std::vector<DeviceReady> ready;
  std::string text;  // the source of the description

  static constexpr std::size_t max_text = 65536;  // bytes
  static constexpr std::size_t max_lines = 256;   // of each kind of line

  std::optional<std::size_t> find(std::string_view value) const;

  // Throws Error{data} with the line. `source`: the name of the text in the error.
  static DeviceDescription parse(std::string_view text, const std::string& source = "description");
  // Loads a shipped description by name, or a file: a name with '/' or with the ending ".device".
  // Throws Error{usage} for an unknown name, Error{open}, Error{permission}, and as parse().
  static DeviceDescription load(const std::string& name_or_path);
  // The shipped descriptions' names, and a text by name. Throws Error{usage} for an unknown name.
  static std::vector<std::string> shipped();
  static std::string_view text_of(const std::string& name);
};

}  // namespace r4
