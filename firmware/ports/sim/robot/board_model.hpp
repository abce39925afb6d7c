// SPDX-License-Identifier: GPL-3.0-or-later
// The R4 board around its microcontroller: the chips on their bus, the pins, the connected devices,
// and their time. Portable and in integers, because the image for the Cortex-M7 runs it, too.
//
// The vehicle of the paper's capture (section 4.4) on the bench is connected, or a RobotModel with
// the bench's supply, handle and steppers:
//
//     supply      of the motors: on while the dead-man's handle is held and relay 1 is closed. A
//                 missing handle or relay does not interrupt the supply.
//     OSMC 1-4    a motor each, whose shaft turns encoder 1-4: 4000 counts a second at full duty;
//                 the index line is high for one of the 1000 counts of a turn, count 0
//     DHB1A       the steering motor; AINSTEER is its position: 1 V at the forward end, 4 V at the
//                 reverse end, 1.5 s from end to end at full duty
//     battery     AIN24 sags with the current of the OSMC motors (20 mOhm)
//     US 1-4      ultrasonic sensors without an obstacle
//     steppers    a motor each that takes a step at each pulse
//
// Settings do not change the model's wiring. An unconnected pin reads low, or high with a pull-up.
// An analog input takes each value of the capture as often as the capture has that value. Only the
// seed and the time choose the value.
#pragma once

#include <cstdint>

#include "../devices/user_devices.hpp"
#include "board_chips.hpp"
#include "motor_model.hpp"
#include "pin_models.hpp"
#include "r4link/simulation/simulated_pins.hpp"
#include "ultrasonic_model.hpp"

namespace r4 {
namespace sim {

// Defects around the board: numbers of bits.
namespace defects {
enum Index : std::uint8_t {
  encoder_a,                                 // encoder 1 … : the line stays low
  encoder_b = encoder_a + encoder_channels,  // encoder 1 … : the line stays low
  echo = encoder_b + encoder_channels,       // sensor 1 … : the line floats
  relay = echo + ultrasonic_channels,        // relay 1 … : the contact stays open
  handle = relay + relay_channels,           // the handle's wire is broken
  bypass,                                    // relay 1 is not in the motors' supply
  servos,                                    // the servos have no supply
  store,                                     // the board keeps no settings over a reboot
  count
};
}  // namespace defects

class BoardModel {
 public:
  class Interrupts {
   public:
    virtual void on_edge(const firmware::InputPin& pin, bool high, std::uint32_t at_us) = 0;

   protected:
    ~Interrupts() = default;
  };
  static constexpr std::uint32_t stepper_pause_ms = 100;
  static constexpr std::int32_t hand_speed = 1000;  // counts a millisecond
  static constexpr std::int32_t counts_a_turn = 1000;
  static constexpr int supply_relay = 1;  // the relay whose contact is in the motors' supply

  explicit BoardModel(std::uint64_t seed, const Wiring& wiring = plan_wiring());

  // Motors are stopped, counters are at 0. Does not change the surroundings.
  void power_on();
  // Reports the levels of the encoders, as if they had just changed.
  void tell_levels(Interrupts& interrupts);
  // The millisecond ends at `now_us` of the microcontroller's clock.
  void pass_millisecond(std::uint32_t now_us, Interrupts& interrupts);

  BoardChips& chips() { return chips_; }
  const BoardChips& chips() const { return chips_; }
  UserDevices& devices() { return devices_; }
  firmware::BoardPins microcontroller_pins(const Wiring& wiring);
  firmware::InputPin& input_at(Place place);
  Pins pins() const;
  // True if pins() may have changed: shortly after a transfer, a step or disturb_pins().
  bool pins_may_differ();
  // Call after a change of the chips without a transfer.
  void disturb_pins() { disturbed_ms_ = time_ms_; }
  bool motors_have_supply() const;
  // Counts of an encoder's shaft since power_on().
  std::int32_t shaft_count(int channel) const { return shafts_[channel - 1].count; }

  // Steps of the motor since power_on(), forward minus backward.
  std::int32_t stepper_shaft(int channel) const { return steppers_[channel - 1].driver.shaft(); }

  // The robot must outlive the model; nullptr: the vehicle on the bench.
  void connect(RobotModel* robot);

  // The surroundings. Channels are numbered from 1. A RobotModel sets its own motors and encoders.
  void hold_handle(bool held);
  bool handle_held() const { return handle_held_; }
  void set_gpio(int channel, bool high) { input(SignalKind::gpio, channel).set(high); }
  std::uint16_t dac_mv(int channel) const { return dac_[channel - 1].millivolts(); }
  // `cm`: distance; 0: no obstacle.
  void set_ultrasonic(int channel, std::uint16_t cm) { sensors_[channel - 1].set_distance(cm); }
  void connect_ultrasonic(int channel, bool connected) { sensors_[channel - 1].connect(connected); }
  // A hand turns the shaft to `counts` since power_on().
  void turn_encoder(int channel, std::int32_t counts);
  void stall_motor(int channel, bool stalled) { shafts_[channel - 1].stalled = stalled; }
  void pin_analog(Analog input, std::int32_t centivolts);
  // The divider of an input gives this many hundredths of its nominal voltage.
  void set_divider(Analog input, std::int32_t hundredths);
  // `index`: a defects::Index.
  void set_defect(int index, bool broken);
  bool is_broken(int index) const { return (defects_ >> index & 1U) != 0; }
  bool relay_contact_closed(int channel) const {
    return chips_.relay_closed(channel) && !is_broken(defects::relay + channel - 1);
  }
  std::int32_t analog_cv(Analog input) const;
  const UltrasonicModel& ultrasonic(int channel) const { return sensors_[channel - 1]; }

 private:
  static constexpr std::uint32_t settling_ms = 5;  // for a chip's outputs, after a transfer
  static constexpr std::int32_t steering_range = 3 * 1000 * 2048;  // 1.5 s of 4096 a millisecond

  struct Shaft {
    MotorModel motor;
    std::int32_t count = 0;
    bool stalled = false;
    bool by_hand = false;
    std::int32_t hand_count = 0;  // target of the hand
  };
  struct Stepper {
    StepperDriverModel driver;
    std::uint32_t pulses = 0;
    std::uint32_t pause_ms = stepper_pause_ms;
  };
  struct OpenAnalogPin final : firmware::AnalogPin {
    std::uint16_t read() override { return 0; }
  };
  struct Converter final : firmware::AnalogPin {
    std::uint16_t read() override;
    const BoardModel* model = nullptr;
    int input = 0;
    std::uint32_t at_ms = 0;
    bool converted = false;
    std::uint16_t counts = 0;
  };

  void pass_millisecond_of(RobotModel& robot, Interrupts& interrupts);
  void turn_bench_motors(Interrupts& interrupts);
  void turn(int channel, std::int32_t counts, Interrupts& interrupts);
  void set_encoder_levels(int channel);
  int signal_at(Place place) const;
  firmware::OutputPin& output_at(Place place);
  firmware::AnalogPin& analog_at(Place place);
  InputPinModel& input(SignalKind kind, int channel) {
    return pins_[signal_index(kind, channel) - first_pin];
  }
  void steer(Drive drive);
  void convert_again();

  std::uint64_t seed_;
  RobotModel* robot_ = nullptr;
  RobotModel::Senses senses_;
  std::uint32_t time_ms_ = 0;
  std::uint32_t now_us_ = 0;  // time of the microcontroller's clock
  BoardChips chips_;
  UserDevices devices_;
  Stepper steppers_[stepper_channels];
  Shaft shafts_[encoder_channels];
  std::int32_t steering_ = 0;  // position, from 0 at the forward end to steering_range
  UltrasonicModel sensors_[ultrasonic_channels];
  bool handle_held_ = true;
  // The levels of the signals that end at a pin of the Giga; levels of outputs are not used.
  static constexpr int first_pin = signals::handle;
  static constexpr int last_pin = signals::gpio_last;
  InputPinModel pins_[last_pin - first_pin + 1];
  InputPinModel open_input_;
  OutputPinModel open_output_;
  AnalogOutputPinModel dac_[dac_channels];
  Converter converters_[analog_channels];
  OpenAnalogPin open_analog_;
  std::int32_t pinned_cv_[analog_channels] = {};
  std::uint32_t bus_transfers_ = 0;  // transfers at the last pins_may_differ()
  std::uint32_t disturbed_ms_ = 0;   // last time that pins may have changed
  std::int32_t divider_[analog_channels] = {100, 100, 100, 100, 100, 100};
  std::uint32_t defects_ = 0;
  std::uint8_t pinned_ = 0;  // bit n: analog input n stays at pinned_cv_[n]
};

}  // namespace sim
}  // namespace r4
