// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <chrono>
#include <optional>
#include <string>

#include "check_functions.hpp"

namespace r4::commissioning {
namespace {

using namespace std::chrono_literals;

constexpr Duration half_a_second = 500ms;

using MakeCommand = Command (*)(Channel, Pwm, Direction);

struct EncoderTravel {
  std::optional<ReceivedState> first;
  ReceivedState last;
  void take(const ReceivedState& state) {
    if (!first) first = state;
    last = state;
  }
  void report(Checking& c) const {
    if (!first) return;
    for (int i = 1; i <= encoder_channels; ++i) {
      const std::int32_t counts = last.encoder(i) - first->encoder(i);
      if (counts != 0) c.measured(fmt::format("encoder {}, forward", i), counts, "counts");
    }
  }
};

// Moves in reverse first. A driver may have an input for each direction, while the wiring has pwm
// and direction. A slow forward command would drive the motor at nearly full speed in reverse.
void check_motor(Checking& c, Thing commanded, MakeCommand make) {
  const Pwm low = Duty(0.1).pwm();
  // Rests in reverse, as in the safe state. Forward may be a high line, which would drive a driver
  // with an input for each direction.
  const Command rest = make(commanded.channel, Pwm(0), Direction::reverse);
  const auto move = [&](Thing turning, Direction direction, const char* way,
                        EncoderTravel& travel) {
    c.move(fmt::format("Relay 1 closes (a click), then {} turns {} for half a second, at a tenth "
                       "of full duty.",
                       name_of(turning), way),
           make(commanded.channel, low, direction), rest, half_a_second,
           [&](const ReceivedState& state) { travel.take(state); });
  };
  c.select_fields("DEFAULT,ENC1,ENC2,ENC3,ENC4");
  EncoderTravel backward, forward;
  move(commanded, Direction::reverse, "BACKWARD", backward);
  const auto seen = c.which(commanded, "Which motor turned?");
  if (!seen) return c.found(Finding::does_not_move);
  if (c.confirms(Topic::forward, "Did it turn FORWARD? (It should have turned backward.)")) {
    const bool may_be_two_pwm = row_of(commanded.first).terminal == Terminal::drive_line &&
                                !c.report.wiring.places[commanded.signal()].option();
    if (may_be_two_pwm &&
        c.confirms(Topic::two_pwm_inputs,
                   "Has the driver of this motor two PWM inputs, one for each direction? "
                   "See its data sheet.")) {
      c.found(Finding::two_pwm);
      return c.learnt({Learnt::What::option, commanded.signal(), 0, {}, 1});
    }
    c.found(Finding::reversed);
    return c.learnt(
        {Learnt::What::option, commanded.signal() + row_of(commanded.first).channels, 0, {}, 1});
  }
  move(*seen, Direction::forward, "FORWARD", forward);
  forward.report(c);
  if (!c.confirms(Topic::forward, "Did the same motor turn FORWARD, as slowly as before?")) {
    c.found(Finding::one_way);
  }
}

// While the motor rests, its brake is on, as in the safe state.
Command bldc_at(Channel channel, Pwm speed, Direction direction) {
  return Command::bldc(channel, speed, direction, speed.value == 0);
}

}  // namespace

void check_motor_supply(Checking& c, int) {
  if (c.confirms(
          Topic::supply_with_relay_open,
          "Switch the motor supply on. Hold a meter at the supply of a motor driver. Relay 1 "
          "is open: does the meter show the motor supply?")) {
    return c.found(Finding::relay_1_not_in_supply);
  }
  const Command relay_1 = Command::relay(1, true);
  c.move(
      "Relay 1 closes for two seconds (a click): the motor drivers have supply, and the motors do "
      "not turn. Look at the meter.",
      relay_1, std::nullopt, 2s);
  if (!c.confirms(Topic::supply_with_relay_closed,
                  "Did the meter show the motor supply while you held the key?")) {
    c.found(Finding::no_motor_supply);
  }
}

void check_relay(Checking& c, int channel) {
  std::optional<Command> rest;
  if (channel != 1) rest = Command::relay(channel, false);
  c.move(channel == 1 ? std::string("Relay 1 closes for half a second.")
                      : fmt::format("Relay 1 closes (a click), then relay {} for half a second (a "
                                    "second click).",
                                    channel),
         Command::relay(channel, true), rest, half_a_second);
  if (!c.which({SignalKind::relay, channel}, "Which relay clicked last?")) {
    c.found(Finding::relay_dead);
  }
}

void check_servo(Checking& c, int channel) {
  c.move(fmt::format("Relay 1 closes (a click), then servo {} goes to its middle, as fast as it "
                     "can, and is off after half a second.",
                     channel),
         Command::servo(channel, Microseconds(1500)), Command::servo(channel, Microseconds(0)),
         half_a_second);
  if (c.which({SignalKind::servo, channel}, "Which servo moved?")) return;
  const bool supplied = c.confirms(
      Topic::servo_supply,
      fmt::format("Does a meter show 5 V between the outer pins of the header of servo {}?",
                  channel));
  c.found(supplied ? Finding::does_not_move : Finding::servo_without_supply);
}

void check_osmc(Checking& c, int channel) {
  check_motor(c, {SignalKind::osmc_pwm, channel}, Command::osmc);
}
void check_dhb12(Checking& c, int channel) {
  check_motor(c, {SignalKind::dhb12_pwm, channel}, Command::dhb12);
}
void check_bldc(Checking& c, int channel) {
  check_motor(c, {SignalKind::bldc_speed, channel}, bldc_at);
}

void check_stepper(Checking& c, int channel) {
  constexpr std::int32_t steps = 100;
  c.move(fmt::format("Relay 1 closes (a click), then stepper {} takes {} steps FORWARD in half a "
                     "second.",
                     channel, steps),
         Command::stepper(channel, Steps(steps), StepsPerSecond(2 * steps)), Command::zero(channel),
         half_a_second);
  const auto seen = c.which({SignalKind::step, channel}, "Which stepper turned?");
  if (!seen) return c.found(Finding::does_not_move);
  if (c.confirms(Topic::forward, "Did it turn FORWARD?")) return;
  c.found(Finding::reversed);
  c.learnt({Learnt::What::option, signal_index(SignalKind::step_direction, channel), 0, {}, 1});
}

}  // namespace r4::commissioning
