// SPDX-License-Identifier: GPL-3.0-or-later
// r4::Device: a described device at an address of a board's user I2C bus, with the slots of its readings.
//
//     const auto imu = r4::Device::from("bno055@0x28");
//     board.arm();            // setting it up may write to it
//     board.attach(imu);      // is it that device? Sets it up, and has the board read it from now on
//     for (;;) {
//       const r4::State state = board.next_state();
//       const r4::DeviceReading turn = imu.reading(state, "gyro_z");   // turn.number in rad/s, turn.t_ms
//     }
//
// What is read is decoded from a state alone, so that it works for a recording and for who only watches, too.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "../config.hpp"
#include "../error.hpp"
#include "../link.hpp"
#include "../state.hpp"
#include "description.hpp"

namespace r4 {

struct DeviceReading {
  std::optional<double>
      number;  // in the value's unit; nothing before the first, and where it is no measurement
  std::uint32_t t_ms = 0;    // the board's clock when it was read
  std::uint32_t errors = 0;  // readings that failed since it was set up
};

class R4LINK_API Device {
 public:
  // Its readings are in `first_slot` and those that follow, of 1 to 8. Throws Error{usage} for an address that the
  // description does not have, and where the slots do not suffice.
  Device(DeviceDescription description, int address, int first_slot = 1);
  // "NAME[@ADDRESS[:SLOT]]", where NAME is what DeviceDescription::load() takes: "bno055", "bno055@0x28:3",
  // "./mine.device@64". Without an address its usual one; without a slot `first_slot`.
  static Device from(std::string_view text, int first_slot = 1);
  // Of the text of a description instead of its name, as a recording has it: "bno055@0x28:1". Throws Error as
  // DeviceDescription::parse() and the others do.
  static Device parse(std::string_view place, std::string_view description);
  // Several, each behind the other in the slots; those with a slot of their own there. Throws Error{usage} if two
  // have one in common.
  static std::vector<Device> from(const std::vector<std::string>& texts);

  const DeviceDescription& description() const { return description_; }
  int address() const { return address_; }
  int first_slot() const { return first_slot_; }
  int last_slot() const { return first_slot_ + static_cast<int>(description_.polls.size()) - 1; }
  // Is the other, on the same bus, no more once this one is set up? It has its address, or one of its slots.
  bool takes_place_of(const Device& other) const;
  std::string text() const;    // "bno055@0x28"
  std::string place() const;   // "bno055@0x28:1"
  std::string fields() const;  // "I2C1,I2C2", for F: and Board::fields()

  // That brings a value; the value's place is that in description().values.
  StateField field(std::size_t value) const;
  // Whether the device is still as it was set up (DeviceDescription::ready). False: it was reset,
  // or was never set up. Its values are no measurements then; attach it again. Nothing: it was not
  // read yet, or cannot tell.
  std::optional<bool> is_set_up(const State& state) const;
  // True if the value is a measurement as far as the device itself tells: it is set up, and
  // DeviceValue::only holds.
  bool counts(const State& state, std::size_t value) const;
  DeviceReading reading(const State& state, std::size_t value) const;
  // Throws Error{usage} if it has no value of that name.
  DeviceReading reading(const State& state, std::string_view value) const;
  // Of all its values.
  std::vector<DeviceReading> readings(const State& state) const;

 private:
  DeviceDescription description_;
  int address_;
  int first_slot_;
};

// Why a device was not set up (AsyncBoard::async_attach()), and what to do. `link` is the link at that time. Of kind
// refused.
R4LINK_API Problem explain(const Device& device, const CommandResult& result,
                           const LinkStatus& link);

}  // namespace r4
