// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <string>

#include "check_functions.hpp"
#include "r4link/error.hpp"
#include "r4link/tables/state_fields.hpp"
#include "r4link/wiring/wiring_file.hpp"

namespace r4::commissioning {
namespace {

using namespace std::chrono_literals;
using States = std::vector<ReceivedState>;

std::string analog_name(int input) {
  const Text name = r4::name_of(state_field(FieldKind::analog, input));
  return {name.data(), name.size()};
}

double mean_volts(const States& states, int input) {
  double sum = 0;
  for (const State& state : states) sum += state.volts(static_cast<Analog>(input - 1));
  return sum / static_cast<double>(states.size());
}

bool agree(double shown, double meter, double share) {
  return std::abs(shown - meter) <= 0.03 + share * std::abs(meter);
}

// The input that shows the voltage of `input`; 0 if no input or several inputs show it.
int exchanged_with(const Checking& c, const States& states, int input, double meter) {
  int other = 0;
  for (int i = 1; i <= analog_channels; ++i) {
    if (i == input || !agree(mean_volts(states, i), meter, 0.03)) continue;
    for (const CheckResult& earlier : c.report.checks) {
      for (const Learnt& learnt : earlier.learnt) {
        const bool serves_this = learnt.other == signal_index(SignalKind::analog, i) &&
                                 learnt.signal == signal_index(SignalKind::analog, input);
        if (learnt.what == Learnt::What::serves && serves_this) return i;
      }
    }
    if (other != 0) return 0;
    other = i;
  }
  return other;
}

struct Range {
  std::int32_t least = 0;
  std::int32_t most = 0;
  std::int32_t travelled = 0;  // from the first to the last state
};
template <class Read>
Range range_of(const States& states, Read read) {
  if (states.empty()) return {};
  Range range{read(states.front()), read(states.front()), 0};
  for (const State& state : states) {
    range.least = std::min(range.least, read(state));
    range.most = std::max(range.most, read(state));
  }
  range.travelled = read(states.back()) - read(states.front());
  return range;
}

States states_until_now(Checking& c) {
  States states = c.states_since_forget();
  const States more = c.collect(100ms);
  states.insert(states.end(), more.begin(), more.end());
  return states;
}

void find_handle(Checking& c, const State& held, const State& released) {
  const unsigned changed = held.gpio ^ released.gpio;
  for (int i = 1; i <= gpio_channels; ++i) {
    if (changed != 1U << (i - 1)) continue;
    const int input = signal_index(SignalKind::gpio, i);
    Place place{c.report.wiring.places[input].number()};
    if ((held.gpio & changed) == 0) place.byte |= Place::option_bit;
    c.found(Finding::handle_elsewhere, place_name(signals::handle, place));
    c.learnt(
        {Learnt::What::place, input, 0, Place{c.report.wiring.at(SignalKind::handle).number()}, 1});
    c.learnt({Learnt::What::place, signals::handle, 0, place, 1});
    return;
  }
  const bool low =
      (held.handle == Handle::released) != c.report.wiring.at(SignalKind::handle).option();
  c.found(low ? Finding::handle_missing : Finding::handle_stuck);
}

// Distances of a sensor over some readings, at 4 readings a second.
struct Sight {
  Range range;
  bool near = false;  // always between 5 and 50 cm
  bool unsteady = false;
};
Sight sight_of(const States& states, int channel) {
  Sight sight;
  sight.range = range_of(states, [&](const State& state) { return state.distance_cm(channel); });
  sight.near = sight.range.least >= 5 && sight.range.most <= 50;
  sight.unsteady = sight.range.most - sight.range.least > 20;
  return sight;
}

}  // namespace

void check_supply(Checking& c, int input) {
  const std::string name = analog_name(input);
  const double meter = c.number(
      Topic::meter,
      fmt::format("{}What does the multimeter show in front of the divider of {}, against 0 V? 0: "
                  "nothing is connected.",
                  name == "AINDMH" ? "Hold the handle. " : "", name),
      "V");
  if (meter == 0) Checking::give_up(Status::skipped, "nothing is connected");
  std::string names;
  for (int i = 1; i <= analog_channels; ++i) names += (i == 1 ? "" : ",") + analog_name(i);
  c.select_fields(names);
  const States states = c.collect(300ms);
  const double shown = mean_volts(states, input);
  c.measured("shown", shown, "V");
  c.measured("meter", meter, "V");
  if (agree(shown, meter, 0.01)) return;
  const Thing thing{SignalKind::analog, input};
  if (!agree(shown, meter, 0.1)) {
    if (const int other = exchanged_with(c, states, input, meter)) {
      c.found(Finding::exchanged, analog_name(other) + " shows its voltage");
      // The voltage is at the place of the other input.
      return c.learnt(
          {Learnt::What::serves, Thing{SignalKind::analog, other}.signal(), thing.signal(), {}, 1});
    }
    if (shown < 0.1) return c.found(Finding::no_voltage);
    c.found(Finding::divider_wrong, fmt::format("{:.2f} V instead of {:.2f} V", shown, meter));
  }
  if (meter > 0 && shown >= 0.1)
    c.learnt({Learnt::What::full_scale, thing.signal(), 0, {}, meter / shown});
}

void check_handle(Checking& c, int) {
  c.select_fields("DMHSTA,AINDMH,GPIO");
  c.require(Topic::handle_held, "Hold the dead-man's handle, and confirm while you hold it.",
            "the handle was not held");
  const State held = states_until_now(c).back();
  if (held.handle == Handle::none) return c.note("the wiring of the board has no handle");
  c.require(Topic::handle_released, "Now release the handle, and confirm.",
            "the handle was not released");
  const State released = states_until_now(c).back();
  c.measured("AINDMH held", held.volts(Analog::aindmh), "V");
  c.measured("AINDMH released", released.volts(Analog::aindmh), "V");
  if (held.handle == released.handle) return find_handle(c, held, released);
  if (held.handle == Handle::released) {
    c.found(Finding::handle_inverted);
    return c.learnt({Learnt::What::option, signals::handle, 0, {}, 1});
  }
  c.require(Topic::handle_held, "Hold the handle again, and confirm.", "the handle is released");
}

void check_encoder(Checking& c, int channel) {
  c.select_fields("ENC1,ENC2,ENC3,ENC4,ENC1IDX,ENC2IDX,ENC3IDX,ENC4IDX");
  States states{c.collect(50ms).back()};
  c.board.forget_states();
  c.require_connected(
      Topic::wheel_turned,
      fmt::format("Turn the wheel of encoder {} forward by hand, one full turn within a few "
                  "seconds, and confirm (n: no encoder is connected).",
                  channel));
  const States turning = states_until_now(c);
  states.insert(states.end(), turning.begin(), turning.end());
  const auto range = [&](int encoder) {
    return range_of(states, [&](const State& state) { return state.encoder(encoder); });
  };
  int seen = channel;
  for (int i = 1; i <= encoder_channels; ++i) {
    const Range own = range(seen);
    const Range other = range(i);
    if (other.most - other.least > own.most - own.least) seen = i;
  }
  const Range turned = range(seen);
  constexpr std::int32_t enough = 8;  // counts of one turn
  c.measured("counts a turn", std::abs(turned.travelled), "");
  if (seen != channel) {
    c.learnt_exchange({SignalKind::encoder_a, seen}, {SignalKind::encoder_a, channel});
  }
  if (turned.most == turned.least) return c.found(Finding::encoder_silent);
  if (turned.most - turned.least < enough) return c.found(Finding::encoder_channel_dead);
  if (turned.travelled < 0) {
    c.found(Finding::reversed);
    const Wiring& wiring = c.report.wiring;
    const int a = signal_index(SignalKind::encoder_a, seen);
    const int b = signal_index(SignalKind::encoder_b, seen);
    c.learnt({Learnt::What::place, a, 0, wiring.places[b], 1});
    c.learnt({Learnt::What::place, b, 0, wiring.places[a], 1});
  }
}

void check_ultrasonic(Checking& c, int channel) {
  constexpr Duration readings = 800ms;  // three readings of each sensor
  c.select_fields("US1,US2,US3,US4");
  c.require_connected(
      Topic::hand_before_sensor,
      fmt::format("Hold your hand still, about 20 cm in front of ultrasonic sensor {}, and confirm "
                  "while the hand is there (n: no sensor is connected).",
                  channel));
  c.collect(300ms);  // time for one reading of each sensor
  c.board.forget_states();
  const States with_hand = c.collect(readings);
  c.require(Topic::hand_away, "Take your hand away: the way is free for 1 m. Confirm.",
            "the way was not free");
  c.collect(300ms);
  c.board.forget_states();
  const States without_hand = c.collect(readings);
  const Sight own = sight_of(with_hand, channel);
  const Sight free = sight_of(without_hand, channel);
  c.measured("hand", own.range.most, "cm");
  c.measured("free", free.range.most, "cm");
  if (own.unsteady || free.unsteady) return c.found(Finding::echo_unsteady);
  if (own.near && !free.near) return;
  if (own.near) return c.found(Finding::ultrasonic_blocked);
  for (int i = 1; i <= ultrasonic_channels; ++i) {
    if (sight_of(with_hand, i).near && !sight_of(without_hand, i).near) {
      return c.learnt_exchange({SignalKind::trigger, i}, {SignalKind::trigger, channel});
    }
  }
  c.found(Finding::ultrasonic_silent);
}

}  // namespace r4::commissioning
