// SPDX-License-Identifier: GPL-3.0-or-later
#include "board_model.hpp"

#include "random.hpp"

namespace r4 {
namespace sim {

namespace {

static_assert(osmc_channels == encoder_channels, "each of these motors turns an encoder");

struct Level {
  std::int16_t centivolts;
  std::uint8_t count;
};

// From the capture (paper section 4.4).
constexpr Level ain24[] = {{2413, 4},  {2415, 1}, {2418, 6}, {2421, 6},
                           {2428, 33}, {2431, 7}, {2433, 4}, {2456, 1}};
constexpr Level ain12[] = {{1208, 5},  {1209, 2},  {1211, 4},  {1212, 3}, {1214, 1},
                           {1215, 20}, {1216, 11}, {1218, 11}, {1219, 3}, {1221, 2}};
constexpr Level ain5[] = {{507, 3},  {508, 3},  {509, 9}, {510, 4},
                          {511, 24}, {512, 14}, {513, 4}, {515, 1}};
constexpr Level aindmh_held[] = {{1183, 1},  {1193, 1}, {1208, 2}, {1209, 2}, {1211, 4},
                                 {1212, 6},  {1214, 4}, {1215, 6}, {1216, 9}, {1218, 9},
                                 {1219, 10}, {1221, 3}, {1222, 3}, {1223, 1}, {1229, 1}};
constexpr Level ainsteer[] = {{86, 2},  {92, 2},   {94, 2},  {95, 4},  {98, 7},
                              {99, 12}, {100, 10}, {102, 2}, {103, 8}, {105, 10},
                              {106, 1}, {107, 1},  {119, 1}};
// Levels of an undriven input, and of the input of a released handle.
constexpr Level near_zero[] = {{0, 4}, {1, 2}, {2, 1}};

template <std::size_t N>
std::int32_t pick(const Level (&levels)[N], std::uint64_t random) {
  std::uint32_t total = 0;
  for (const Level& level : levels) total += level.count;
  std::uint32_t at = static_cast<std::uint32_t>(random % total);
  for (const Level& level : levels) {
    if (at < level.count) return level.centivolts;
    at -= level.count;
  }
  return levels[N - 1].centivolts;
}

constexpr SignalKind encoder_signals[] = {SignalKind::encoder_a, SignalKind::encoder_b,
                                          SignalKind::encoder_index};

constexpr std::int32_t steering_span_cv = 300;  // from end to end
constexpr std::int32_t battery_mohm = 20;

}  // namespace

bool Pins::is_safe() const {
  for (const Stepper& each : stepper) {
    if (each.stepping != 0) return false;
  }
  return ChipPins::is_safe();
}

bool operator==(const Pins& a, const Pins& b) {
  for (int i = 0; i < stepper_channels; ++i) {
    if (a.stepper[i].stepping != b.stepper[i].stepping) return false;
  }
  return static_cast<const ChipPins&>(a) == static_cast<const ChipPins&>(b);
}

BoardModel::BoardModel(std::uint64_t seed, const Wiring& wiring) : seed_(seed), chips_(wiring) {
  for (int i = 0; i < analog_channels; ++i) {
    converters_[i].model = this;
    converters_[i].input = i;
  }
  for (int i = 1; i <= gpio_channels; ++i) set_gpio(i, true);  // pulled up
  for (int i = 0; i < stepper_channels; ++i) {
    steppers_[i].driver.set_forward_level(!wiring.at(SignalKind::step_direction, i + 1).option());
  }
  hold_handle(true);
}

void BoardModel::power_on() {
  chips_.power_on();
  devices_.power_on();
  for (Stepper& stepper : steppers_) {
    stepper.driver.power_on();
    stepper.pause_ms = stepper_pause_ms;
  }
  for (Shaft& shaft : shafts_) {
    const bool stalled = shaft.stalled;
    shaft = Shaft();
    shaft.stalled = stalled;
  }
}

void BoardModel::hold_handle(bool held) {
  handle_held_ = held;
  const bool low_is_held = chips_.wiring.at(SignalKind::handle).option();
  input(SignalKind::handle, 1).set(held != low_is_held && !is_broken(defects::handle));
  convert_again();
}

bool BoardModel::motors_have_supply() const {
  const Wiring& wiring = chips_.wiring;
  return (handle_held_ || !wiring.at(SignalKind::handle).connected()) &&
         (relay_contact_closed(supply_relay) || is_broken(defects::bypass) ||
          !wiring.at(SignalKind::relay, supply_relay).connected());
}

void BoardModel::turn_encoder(int channel, std::int32_t counts) {
  shafts_[channel - 1].by_hand = true;
  shafts_[channel - 1].hand_count = counts;
}

void BoardModel::set_divider(Analog input, std::int32_t hundredths) {
  divider_[static_cast<int>(input)] = hundredths;
  convert_again();
}

void BoardModel::set_defect(int index, bool broken) {
  const std::uint32_t bit = 1U << index;
  defects_ = broken ? defects_ | bit : defects_ & ~bit;
  hold_handle(handle_held_);
}

void BoardModel::pin_analog(Analog input, std::int32_t centivolts) {
  pinned_cv_[static_cast<int>(input)] = centivolts;
  pinned_ = static_cast<std::uint8_t>(pinned_ | 1U << static_cast<int>(input));
  convert_again();
}

// The signal of this board at a pin of the Giga; signals::count: none.
int BoardModel::signal_at(Place place) const {
  if (!place.connected()) return signals::count;
  for (int i = first_pin; i <= last_pin; ++i) {
    const Place& each = chips_.wiring.places[i];
    if (each.connected() && each.number() == place.number()) return i;
  }
  return signals::count;
}

firmware::InputPin& BoardModel::input_at(Place place) {
  const int signal = signal_at(place);
  return signal == signals::count ? open_input_ : pins_[signal - first_pin];
}

firmware::OutputPin& BoardModel::output_at(Place place) {
  const int signal = signal_at(place);
  if (signal == signals::count) return open_output_;
  const SignalKind kind = signal_kind(signal);
  const int index = signal - row_of(kind).first;
  if (kind == SignalKind::step) return steppers_[index].driver.step();
  if (kind == SignalKind::step_direction) return steppers_[index].driver.direction();
  if (kind == SignalKind::trigger) return sensors_[index].trigger();
  return open_output_;
}

firmware::AnalogPin& BoardModel::analog_at(Place place) {
  const int signal = signal_at(place);
  if (signal < signals::analog || signal > signals::analog_last) return open_analog_;
  return converters_[signal - signals::analog];
}

firmware::BoardPins BoardModel::microcontroller_pins(const Wiring& wiring) {
  firmware::BoardPins pins{};
  for (int i = 0; i < stepper_channels; ++i) {
    pins.step[i] = &output_at(wiring.at(SignalKind::step, i + 1));
    pins.direction[i] = &output_at(wiring.at(SignalKind::step_direction, i + 1));
  }
  for (int i = 0; i < ultrasonic_channels; ++i) {
    pins.trigger[i] = &output_at(wiring.at(SignalKind::trigger, i + 1));
  }
  for (int i = 0; i < analog_channels; ++i) {
    pins.analog[i] = &analog_at(wiring.at(SignalKind::analog, i + 1));
  }
  pins.handle = &input_at(wiring.at(SignalKind::handle));
  for (int i = 0; i < dac_channels; ++i) pins.dac[i] = &dac_[i];
  for (int i = 0; i < gpio_channels; ++i) {
    pins.gpio[i] = &input_at(wiring.at(SignalKind::gpio, i + 1));
  }
  return pins;
}

void BoardModel::pass_millisecond(std::uint32_t now_us, Interrupts& interrupts) {
  ++time_ms_;
  now_us_ = now_us;
  chips_.bus.advance(1000);
  devices_.pass_millisecond();
  const bool supplied = motors_have_supply();
  if (robot_ != nullptr) {
    pass_millisecond_of(*robot_, interrupts);
  } else {
    turn_bench_motors(interrupts);
    if (supplied) steer(chips_.dhb12_drive(1));
  }
  for (int i = 0; i < ultrasonic_channels; ++i) {
    if (is_broken(defects::echo + i)) {
      constexpr std::uint64_t range_cm = 400;
      sensors_[i].set_distance(
          static_cast<std::uint16_t>(1 + scramble(seed_ ^ time_ms_) % range_cm));
    }
    sensors_[i].pass(now_us, [&](bool high, std::uint32_t at_us) {
      InputPinModel& pin = input(SignalKind::echo, i + 1);
      pin.set(high);
      interrupts.on_edge(pin, high, at_us);
    });
  }
  for (Stepper& stepper : steppers_) {
    stepper.driver.supply_motor(supplied);
    if (stepper.pulses != stepper.driver.pulses()) {
      stepper.pulses = stepper.driver.pulses();
      stepper.pause_ms = 0;
    } else if (stepper.pause_ms < stepper_pause_ms) {
      ++stepper.pause_ms;
    }
  }
}

void BoardModel::turn_bench_motors(Interrupts& interrupts) {
  const bool supplied = motors_have_supply();
  for (int i = 0; i < encoder_channels; ++i) {
    Shaft& shaft = shafts_[i];
    std::int32_t counts =
        shaft.motor.pass_millisecond(supplied ? chips_.osmc_drive(i + 1) : Drive());
    if (shaft.stalled) {
      shaft.motor.stop();
      counts = 0;
    }
    if (shaft.by_hand) {
      const std::int64_t left = std::int64_t{shaft.hand_count} - shaft.count;
      shaft.by_hand = left > hand_speed || left < -hand_speed;
      counts = !shaft.by_hand ? static_cast<std::int32_t>(left)
               : left > 0     ? hand_speed
                              : -hand_speed;
    }
    turn(i + 1, counts, interrupts);
  }
}

void BoardModel::connect(RobotModel* robot) {
  robot_ = robot;
  senses_ = RobotModel::Senses();
}

void BoardModel::pass_millisecond_of(RobotModel& robot, Interrupts& interrupts) {
  const RobotModel::Senses before = senses_;
  for (std::int32_t& turned : senses_.encoder_turned) turned = 0;
  robot.pass_millisecond(chips_.pins(), motors_have_supply(), senses_);
  for (int i = 0; i < encoder_channels; ++i) turn(i + 1, senses_.encoder_turned[i], interrupts);
  for (int i = 0; i < ultrasonic_channels; ++i) {
    if (senses_.ultrasonic_cm[i] != before.ultrasonic_cm[i]) {
      sensors_[i].set_distance(senses_.ultrasonic_cm[i]);
    }
  }
}

void BoardModel::turn(int channel, std::int32_t counts, Interrupts& interrupts) {
  std::int32_t& count = shafts_[channel - 1].count;
  while (counts != 0) {
    const std::int32_t step = counts > 0 ? 1 : -1;
    counts -= step;
    count = static_cast<std::int32_t>(static_cast<std::uint32_t>(count) +
                                      static_cast<std::uint32_t>(step));
    const bool levels[] = {input(SignalKind::encoder_a, channel).read(),
                           input(SignalKind::encoder_b, channel).read(),
                           input(SignalKind::encoder_index, channel).read()};
    set_encoder_levels(channel);
    int i = 0;
    for (const SignalKind kind : encoder_signals) {
      InputPinModel& pin = input(kind, channel);
      if (pin.read() != levels[i++]) interrupts.on_edge(pin, pin.read(), now_us_);
    }
  }
}

// Forward: A leads B, 00 10 11 01.
void BoardModel::set_encoder_levels(int channel) {
  const std::int32_t count = shafts_[channel - 1].count;
  const unsigned quarter = static_cast<unsigned>(count) & 3U;
  const int i = channel - 1;
  const bool a = (quarter == 1 || quarter == 2) && !is_broken(defects::encoder_a + i);
  const bool b = (quarter == 2 || quarter == 3) && !is_broken(defects::encoder_b + i);
  input(SignalKind::encoder_a, channel).set(a);
  input(SignalKind::encoder_b, channel).set(b);
  input(SignalKind::encoder_index, channel).set(count % counts_a_turn == 0);
}

void BoardModel::tell_levels(Interrupts& interrupts) {
  for (int i = 1; i <= encoder_channels; ++i) {
    set_encoder_levels(i);
    for (const SignalKind kind : encoder_signals) {
      interrupts.on_edge(input(kind, i), input(kind, i).read(), now_us_);
    }
  }
}

void BoardModel::steer(Drive drive) {
  steering_ += drive.direction == Direction::forward ? -drive.pwm : drive.pwm;
  if (steering_ < 0) steering_ = 0;
  if (steering_ > steering_range) steering_ = steering_range;
}

std::int32_t BoardModel::analog_cv(Analog input) const {
  const int number = static_cast<int>(input);
  if ((pinned_ >> number & 1) != 0) return pinned_cv_[number];
  if (robot_ != nullptr && senses_.analog_cv[number] != RobotModel::Senses::as_on_the_bench) {
    return senses_.analog_cv[number];
  }
  const std::uint64_t random =
      scramble(seed_ ^ scramble(std::uint64_t{time_ms_} << 8 | static_cast<std::uint64_t>(number)));
  switch (input) {
    case Analog::ain24: {
      std::int32_t current_ca = 0;
      for (const Shaft& shaft : shafts_) current_ca += shaft.motor.current_ca();
      return pick(ain24, random) - current_ca * battery_mohm / 1000;
    }
    case Analog::ain12:
      return pick(ain12, random);
    case Analog::ain5:
      return pick(ain5, random);
    case Analog::aindmh:
      return handle_held_ ? pick(aindmh_held, random) : pick(near_zero, random);
    case Analog::ainsteer:
      return pick(ainsteer, random) + steering_ / (steering_range / steering_span_cv);
    case Analog::ain6:
    case Analog::count:
      break;
  }
  return pick(near_zero, random);
}

void BoardModel::convert_again() {
  for (Converter& converter : converters_) converter.converted = false;
}

// The divider before the converter has a full range of 50 V (drivers/analog.hpp).
std::uint16_t BoardModel::Converter::read() {
  if (converted && at_ms == model->time_ms_) return counts;
  constexpr std::int32_t range_cv = 5000;
  const std::int64_t cv =
      std::int64_t{model->analog_cv(static_cast<Analog>(input))} * model->divider_[input] / 100;
  const auto within = static_cast<std::int32_t>(cv < 0 ? 0 : cv > range_cv ? range_cv : cv);
  counts = static_cast<std::uint16_t>((within * 65535 + range_cv / 2) / range_cv);
  at_ms = model->time_ms_;
  converted = true;
  return counts;
}

bool BoardModel::pins_may_differ() {
  const std::uint32_t transfers = chips_.bus.transfers();
  if (transfers != bus_transfers_) {
    bus_transfers_ = transfers;
    disturb_pins();
  }
  for (const Stepper& stepper : steppers_) {
    if (stepper.pause_ms < stepper_pause_ms || stepper.pulses != stepper.driver.pulses()) {
      disturb_pins();
    }
  }
  return time_ms_ - disturbed_ms_ <= settling_ms;
}

Pins BoardModel::pins() const {
  Pins pins;
  static_cast<ChipPins&>(pins) = chips_.pins();
  for (int i = 0; i < stepper_channels; ++i) {
    const Stepper& stepper = steppers_[i];
    pins.stepper[i].position = stepper.driver.position();
    const bool stepping =
        stepper.pause_ms < stepper_pause_ms || stepper.pulses != stepper.driver.pulses();
    if (stepping) pins.stepper[i].stepping = stepper.driver.forward() ? 1 : -1;
  }
  return pins;
}

}  // namespace sim
}  // namespace r4
