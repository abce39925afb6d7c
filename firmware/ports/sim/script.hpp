// SPDX-License-Identifier: GPL-3.0-or-later
// A scenario for the simulated board: timed events around the board and in it.
//
//     # TIME_S what args        '#' begins a comment; seconds since the start, to the millisecond
//     0.5 handle released       the dead-man's handle: held | released
//     1   us 1 15               ultrasonic sensor 1 sees something at 15 cm; 0: nothing
//     1   us 1 off              its cable is off: no answer, until a line gives a distance
//     1   enc 2 100             encoder 2 is turned to 100 counts, 1000 counts per millisecond
//     1   analog AIN24 21.5     that input stays at 21.5 V
//     1   divider AIN24 0.5     its divider gives half of what it should, until 1
//     1   defect enc1a on       broken, until off: encoder channels enc1a … enc4b (stay low), echo1
//                               … echo4 (float), relay1 … relay8 (stay open), handle (its wire),
//                               bypass (relay 1 is not in the motors' supply), servos (no supply),
//                               store (settings are not kept over a reboot)
//     1   motor 1 stalled       the motor of OSMC 1 is held fast, until free
//     2   chip dac off          the chip (osmc, dhb, servo, expander, dac) acknowledges nothing,
//                               until on; reset: it loses its supply for a moment
//     2   i2c held              a chip holds the bus, until free
//     2   userbus held          a user's device holds SDA, until free; cut: for nine clocks;
//                               stretched: it holds SCL
//     2   device ina219 off     the user's device (mpu6050, ina219, icm20948, bno055, vl53l0x,
//                               as5600) does not answer, until on; reset: as for a chip
//     2   uart 1 noise          the peer of that user's UART: gnss, lidar, loop (TX joined to RX),
//                               noise, off
//     2   gpio 3 low            that spare input is pulled down, until high
//     2   hang 0.3              the firmware's loop hangs for 0.3 s; arriving data is lost
//     3   fault                 the board itself fails
//     3   watchdog              a task of the firmware missed its deadline
//     4   reboot                power off and on again
//
// Lines may be in any order. Lines of the same time are carried out in the order of the file.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace r4::sim {

struct ScriptStep {
  enum class Kind : std::uint8_t {
    handle,
    ultrasonic,
    encoder,
    analog,
    divider,
    defect,
    motor,
    chip,
    i2c,
    user_bus,
    device,
    uart,
    gpio,
    hang,
    fault,
    watchdog,
    reboot
  };
  static constexpr std::int32_t off = -1;  // ultrasonic
  enum class Supply : std::int32_t { off, on, reset };

  Kind kind = Kind::handle;
  std::uint32_t at_ms = 0;
  // ultrasonic, encoder, motor, uart, gpio: 1 …; analog, divider: an Analog; defect: one of
  // defects::Index; chip: a Chip; device: a UserDevice, then an index into OptionalDevices
  int channel = 0;
  // handle, i2c: 1 is held; motor: 1 is stalled; gpio: 1 is high; defect: 1 is broken; ultrasonic:
  // cm, or `off`; encoder: counts; analog: 0.01 V; divider: hundredths; chip, device: a Supply;
  // hang: ms; user_bus: its Fault; uart: a UartPeer
  std::int32_t value = 0;
  std::string text;  // the line without its time, "handle released"
};

class Script {
 public:
  Script() = default;

  // `name`: the file's name in errors. Throws Error{data} as "FILE:LINE: reason; fix".
  static Script parse(std::string_view text, const std::string& name);
  // Throws Error{usage} if the file cannot be read, Error{data} if it is longer than 1 MB.
  static Script load(const std::string& path);
  // A step that is due at once, from a line without a time. Empty for an empty line or a
  // comment. Throws Error{data} as "NAME: reason; fix".
  static std::optional<ScriptStep> parse_now(std::string_view text, const std::string& name);

  const std::vector<ScriptStep>& steps() const { return steps_; }  // in order of time

 private:
  std::vector<ScriptStep> steps_;
};

}  // namespace r4::sim
