// SPDX-License-Identifier: GPL-3.0-or-later
// The hardware as the application needs it: channel values. Each port implements it. No call waits.
#pragma once

#include <cstdint>

#include "r4link/state.hpp"
#include "r4link/vocabulary.hpp"

namespace r4 {
namespace firmware {

struct StepperTarget {
  std::int32_t position = 0;                   // steps
  std::int32_t speed = stepper_speed_default;  // steps per second
  bool enabled = false;                        // false: does not move
  friend bool operator==(const StepperTarget& a, const StepperTarget& b) {
    return a.position == b.position && a.speed == b.speed && a.enabled == b.enabled;
  }
  friend bool operator!=(const StepperTarget& a, const StepperTarget& b) { return !(a == b); }
};

inline void rest(Bldc& channel) { channel.brake = true; }
template <class Value>
void rest(Value&) {}

// Default: the safe state, all off and the brakes on.
struct Outputs {
  Outputs() {
#define R4_OUTPUT(kind, Value, member, ...) \
  for (Value & channel : member) rest(channel);
#include "r4link/tables/board.def"
  }
#define R4_OUTPUT(kind, Value, member, channels, ...) Value member[channels] = {};
#include "r4link/tables/board.def"
  std::uint8_t relays = 0;  // bit n-1: relay n is on
  StepperTarget stepper[stepper_channels];
};
bool operator==(const Outputs& a, const Outputs& b);
inline bool operator!=(const Outputs& a, const Outputs& b) { return !(a == b); }

struct Inputs {
  std::int32_t analog_cv[analog_channels] = {};  // hundredths of a volt
  Handle handle = Handle::released;
  std::int32_t stepper_steps[stepper_channels] = {};
  std::int32_t encoder_counts[encoder_channels] = {};
  std::int32_t encoder_hz[encoder_channels] = {};  // counts per second; negative backwards
  std::int32_t encoder_index_counts[encoder_channels] = {};  // at the index's last rising edge
  std::uint16_t ultrasonic_cm[ultrasonic_channels] = {};     // 0: no echo
  std::uint8_t ultrasonic_blind = 0;                         // bit n-1: sensor n does not answer
  std::uint8_t gpio = 0;                                     // bit n-1: input n is high
  // True if the dead-man's handle is held, or if the board has no handle.
  bool handle_held() const { return handle != Handle::released; }
  ChipFault fault;  // the first fault since the last clear_fault()
};

class Hal {
 public:
  // Called when a setpoint changed. Writes only differences.
  virtual void apply(const Outputs& outputs) = 0;
  // Switches every output off, at once, in any state. A fault handler may call it at any time.
  virtual void make_safe() = 0;
  virtual void sample(Inputs& inputs) = 0;
  // Encoder and stepper `channel` (1 …) restart at zero; the stepper stops.
  virtual void zero(int channel) = 0;
  // Allows outputs after a fault. False if the fault persists.
  virtual bool clear_fault() = 0;

 protected:
  ~Hal() = default;
};

}  // namespace firmware
}  // namespace r4
