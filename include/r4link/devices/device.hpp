// SPDX-License-Identifier: GPL-3.0-or-later
// r4::Device: a described device with its address and its slots on the user's I2C bus.
//     const auto imu = r4::Device::from("bno055@0x28");
//     board.arm();            // the set-up may write to the device
//     board.attach(imu);      // checks and sets up the device; the board then reads it
//     for (;;) {
//       const r4::State state = board.next_state();
//       const r4::DeviceReading turn = imu.reading(state, "gyro_z");   // turn.number in rad/s
//     }
//
// A reading needs only a state, so it also works for watchers and recordings.
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
  // The value in its unit. Empty: no reading yet, or the value is not a measurement.
  std::optional<double> number;
  std::uint32_t t_ms = 0;    // the board's clock at the reading
  std::uint32_t errors = 0;  // failed readings since the setup
};

class R4LINK_API Device {
 public:
  // The readings use the slots from `first_slot`, 1-8. Throws Error{usage} for an address that is
  // not in the description, and for too few slots.
  Device(DeviceDescription description, int address, int first_slot = 1);
  // "NAME[@ADDRESS[:SLOT]]", with NAME as for DeviceDescription::load(): "bno055", "bno055@0x28:3",
  // "./mine.device@64". Defaults: the usual address, and `first_slot`. Throws the errors of load()
  // and the constructor, and Error{usage} for an address or a slot that is not a number.
  static Device from(std::string_view text, int first_slot = 1);
  // From a recording; `place`: "bno055@0x28:1". Throws as DeviceDescription::parse() and Device().
  static Device parse(std::string_view place, std::string_view description);
  // Several devices in successive slots, except devices with a slot in their text. Throws the
  // errors of from() for one text, and Error{usage} if two devices share a slot or an address.
  static std::vector<Device> from(const std::vector<std::string>& texts);

  const DeviceDescription& description() const { return description_; }
  int address() const { return address_; }
  int first_slot() const { return first_slot_; }
  int last_slot() const { return first_slot_ + static_cast<int>(description_.polls.size()) - 1; }
  // True if this device replaces `other` on the same bus: same address, or a shared slot.
  bool takes_place_of(const Device& other) const;
  std::string text() const;    // "bno055@0x28"
  std::string place() const;   // "bno055@0x28:1"
  std::string fields() const;  // "I2C1,I2C2", for F: and Board::fields()

  // The field that carries a value. `value`: index in description().values.
  StateField field(std::size_t value) const;
  // True if the device is set up (DeviceDescription::ready). False if the device was reset or never
  // set up: attach it again, because its values are not measurements. Empty: not known.
  std::optional<bool> is_set_up(const State& state) const;
  // True if DeviceValue::only is true, and the device is set up or cannot report its set-up.
  bool counts(const State& state, std::size_t value) const;
  DeviceReading reading(const State& state, std::size_t value) const;
  // Throws Error{usage} if the device has no value with this name.
  DeviceReading reading(const State& state, std::string_view value) const;
  std::vector<DeviceReading> readings(const State& state) const;

 private:
  DeviceDescription description_;
  int address_;
  int first_slot_;
};

// Why async_attach() failed, and the fix; of kind refused. `link`: the link at that time.
R4LINK_API Problem explain(const Device& device, const CommandResult& result,
                           const LinkStatus& link);

}  // namespace r4
