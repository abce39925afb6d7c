// SPDX-License-Identifier: GPL-3.0-or-later
// The R4 board's chip drivers, wired by a Wiring. A signal without a place or chip has no effect.
//
// Power-up: call power_up() first. power_up() resets the PWM chips, which turns every PWM output
// off in any mode, and makes every output safe. poll() then sets the chips up. ready() is true when
// all chips are set up. Outputs applied earlier wait: no motor runs before its brake works.
//
// Safe state (make_safe()): steppers stopped, PWM outputs off, DAC codes and outputs 0, brakes on,
// relays off. make_safe() may be called at any time, also in an interrupt or a fault handler during
// a transfer. A call makes at most two bounded attempts (a held bus is recovered once).
//
// Chip faults: the fault is latched with chip and reason, all outputs are made safe, and apply()
// has no effect until clear_fault(). Every retry_us the bus is recovered and the chip set up again,
// outputs off first. If a disturbance changed the modes of a PCA9685, all chips that obey the
// general call are reset first. Until the reset, the outputs of that PCA9685 may be on.
//
// A chip's reset is detected within chip_count x verify_us plus one poll; the PCA9685 come first
// after a safe state. poll() and apply() send at most bus_bytes_per_poll bytes each. No call waits.
#pragma once

#include <cstddef>
#include <cstdint>

#include "drivers/analog.hpp"
#include "drivers/bridge.hpp"
#include "drivers/mcp23017.hpp"
#include "drivers/mcp4728.hpp"
#include "drivers/pca9685.hpp"
#include "drivers/pins.hpp"
#include "drivers/quadrature.hpp"
#include "drivers/stepper.hpp"
#include "drivers/ultrasonic.hpp"
#include "hal.hpp"
#include "r4link/wiring/wiring.hpp"

namespace r4 {
namespace firmware {

// The PCA9685 allows at most 1526 Hz.
constexpr std::uint32_t drive_hz = 1000;
constexpr std::uint32_t servo_hz = 50;

// The kinds of motors on H-bridges: names of members of Outputs.
#define R4_DRIVES(DRIVE) DRIVE(osmc) DRIVE(dhb12)

// Set all pins, also those of unconnected signals. The pins must outlive the hardware.
struct BoardPins {
  OutputPin* step[stepper_channels];
  OutputPin* direction[stepper_channels];
  OutputPin* trigger[ultrasonic_channels];
  AnalogPin* analog[analog_channels];
  InputPin* handle;
  AnalogOutputPin* dac[dac_channels];
  InputPin* gpio[gpio_channels];
};

class BoardHardware final : public Hal {
 public:
  struct Config {
    Wiring wiring = plan_wiring();  // has no fault
    // not_confirmed: a fault that clear_fault() ends; damaged, other_bus: a fault until a restart.
    ChipTrouble wiring_trouble = ChipTrouble::none;
    std::int32_t tick_hz = step_tick_hz;
    AnalogCalibration calibration[analog_channels];
  };
  static constexpr std::int32_t step_tick_hz = 40000;
  static constexpr std::size_t bus_bytes_per_poll = 48;
  static constexpr std::uint32_t verify_us = 20000;
  static constexpr std::uint32_t retry_us = 100000;
  static constexpr std::uint32_t handle_settle_us = 20000;
  static_assert(bus_bytes_per_poll >= bus_budget_min, "a set-up would never end");

  static ChipTrouble trouble_of(WiringSource source);

  BoardHardware(I2cBus& bus, const BoardPins& pins, const Config& config);

  void power_up(std::uint32_t now_us);
  // Call about every millisecond.
  void poll(std::uint32_t now_us);

  void apply(const Outputs& outputs) override;
  void make_safe() override;
  void sample(Inputs& inputs) override;
  void zero(int channel) override;
  bool clear_fault() override;  // false while a chip is not ready

  // Full scale in hundredths of a volt, in the order of BoardPins::analog.
  void calibrate(const std::uint16_t (&full_scale_cv)[analog_channels]);

  bool ready() const;
  const Wiring& wiring() const { return config_.wiring; }
  ChipFault fault() const { return fault_; }
  ChipTrouble trouble(Chip chip) const { return chips_[static_cast<int>(chip)]->trouble(); }

  // For interrupts. Channels are numbered from 1.
  void step_tick() {
    for (Stepper& stepper : steppers_) stepper.tick();
  }
  // True if a stepper moves. If no stepper moves, the ticks may pause.
  bool stepping() const;
  QuadratureEncoder& encoder(int channel) { return encoders_[channel - 1]; }
  UltrasonicSensors& ultrasonic() { return ultrasonic_; }

 private:
  static constexpr int nowhere = -1;
  static constexpr int all_chips = chip_count;

  bool fitted(int chip) const { return config_.wiring.chip(static_cast<Chip>(chip)).connected(); }
  void connect_bridges(SignalKind pwm, SignalKind direction, Bridge* bridges);
  bool low_is_forward(int stepper) const;
  std::uint8_t connected_sensors() const;
  std::uint16_t connected_bits() const;
  std::uint16_t ports_of(const Outputs& outputs) const;
  bool handle_reads_held() const;
  void drive_safe();
  int drive_chips_safe(int held_before);
  bool drive_chip_safe(int chip);
  void set_outputs(const Outputs& outputs);
  void for_each_chip(BusBudget& budget, bool set_up);
  void set_up_again();
  void reset_lost_modes();
  void set_up_what_was_cut_off();
  bool look_for_trouble();
  void leave();

  I2cBus& bus_;
  BoardPins pins_;
  Config config_;
  Pca9685 osmc_;
  Pca9685 dhb12_;
  Pca9685 servo_;
  Mcp23017 expander_;
  Mcp4728 dac_;
  ChipDriver* chips_[chip_count];
#define R4_DRIVE(kind) Bridge kind##_bridges_[row_of(SignalKind::kind##_pwm).channels];
  R4_DRIVES(R4_DRIVE)
#undef R4_DRIVE
  Stepper steppers_[stepper_channels];
  QuadratureEncoder encoders_[encoder_channels];
  UltrasonicSensors ultrasonic_;

  Outputs waiting_outputs_;  // applied before every chip was ready
  bool waiting_ = false;
  ChipFault fault_;
  bool failed_[chip_count] = {};
  std::uint32_t failed_us_[chip_count] = {};
  int first_chip_ = 0;                        // the first chip of the next poll
  int verified_chip_ = 0;                     // next chip to verify
  volatile std::uint8_t modes_to_check_ = 0;  // PWM chips left to check after a safe state
  std::uint32_t verified_us_ = 0;
  std::uint32_t now_us_ = 0;
  std::uint32_t held_since_us_ = 0;
  bool handle_seen_ = false;           // the pin read held at the last poll
  bool handle_held_ = false;           // the pin has read held for handle_settle_us
  volatile bool busy_ = false;         // the bus is in use: in poll(), apply() or make_safe()
  volatile bool interrupted_ = false;  // make_safe() interrupted a use of the bus
};

}  // namespace firmware
}  // namespace r4
