// SPDX-License-Identifier: GPL-3.0-or-later
#include "simulated_person.hpp"

#include <algorithm>
#include <bit>
#include <string>

#include "r4link/tables/state_fields.hpp"

namespace r4::simulation {

using commissioning::Answer;
using commissioning::Question;
using commissioning::Topic;

namespace {

constexpr std::uint32_t reaction_ms = 300;

// 3 of "dhb12 3".
int number_in(const std::string& id) { return std::stoi(id.substr(id.find(' '))); }

Analog analog_of(const std::string& id) {
  const std::string name = id.substr(id.find(' ') + 1);
  return static_cast<Analog>(r4::row_of(state_field(Text(name))).channel - 1);
}

}  // namespace

SimulatedPerson::SimulatedPerson(Bench& bench) : bench_(bench) {
  bench_.on_millisecond = [this] { look(); };
}

void SimulatedPerson::see(const std::string& thing, bool forward) {
  for (const Seen& each : seen_) {
    if (each.thing == thing) return;
  }
  seen_.push_back({thing, forward});
}

void SimulatedPerson::look() {
  const sim::BoardModel& model = bench_.model();
  const sim::Pins pins = model.pins();
  const bool supplied = model.motors_have_supply();
  int on = std::popcount(static_cast<unsigned>(pins.relays));
  const auto motor = [&](const char* name, int i, int pwm, Direction direction) {
    if (pwm == 0) return;
    ++on;
    if (supplied) see(name + std::to_string(i + 1), direction == Direction::forward);
  };
  for (int i = 0; i < osmc_channels; ++i) {
    motor("osmc ", i, pins.osmc[i].pwm, pins.osmc[i].direction);
    motor("dhb12 ", i, pins.dhb12[i].pwm, pins.dhb12[i].direction);
    motor("bldc ", i, pins.bldc[i].speed, pins.bldc[i].direction);
  }
  for (int i = 0; i < servo_channels; ++i) {
    if (pins.servo_us[i] == 0) continue;
    ++on;
    if (!model.is_broken(sim::defects::servos)) see("servo " + std::to_string(i + 1), true);
  }
  for (int i = 0; i < stepper_channels; ++i) {
    const std::int32_t position = pins.stepper[i].position;
    const std::int32_t shaft = model.stepper_shaft(i + 1);
    if (position != positions_[i]) ++on;
    if (shaft != shafts_[i]) see("stepper " + std::to_string(i + 1), shaft > shafts_[i]);
    positions_[i] = position;
    shafts_[i] = shaft;
  }
  for (int i = 1; i <= relay_channels; ++i) {
    const auto bit = static_cast<std::uint8_t>(1U << (i - 1));
    const bool closed = model.relay_contact_closed(i);
    if (closed && (contacts_ & bit) == 0) clicks_.push_back(i);
    contacts_ = static_cast<std::uint8_t>(closed ? contacts_ | bit : contacts_ & ~bit);
  }
  supplied_ = supplied_ || supplied;
  if (on != 0 && !moving_) ++unannounced_ms;
  if (on > 2) ++several_ms;
  if (on != 0 && moving_ && !holds_ && bench_.now_ms() - let_go_ms_ > 150) ++not_ended_ms;
}

void SimulatedPerson::say(std::string_view, std::string_view) { moving_ = holds_ = false; }

Answer SimulatedPerson::await_key(const commissioning::Movement&) {
  moving_ = false;
  bench_.pass(reaction_ms);
  if (before_key) std::exchange(before_key, nullptr)();
  seen_.clear();
  clicks_.clear();
  supplied_ = false;
  ++movements;
  moving_ = holds_ = true;
  held_since_ms_ = bench_.now_ms();
  return {};
}

bool SimulatedPerson::holds_key() {
  if (holds_ && lets_go_after_ms && bench_.now_ms() - held_since_ms_ >= *lets_go_after_ms) {
    holds_ = false;
    lets_go_after_ms.reset();
    bench_.pass(std::exchange(hangs_ms, 0));
    let_go_ms_ = bench_.now_ms();
  }
  return holds_;
}

Answer SimulatedPerson::ask(const Question& question) {
  moving_ = holds_ = false;
  bench_.pass(reaction_ms);
  if (otherwise) {
    if (const auto other = otherwise(question)) return *other;
  }
  return answer(question);
}

double SimulatedPerson::meter(Analog input) {
  constexpr int samples = 100;
  double sum = 0;
  for (int i = 0; i < samples; ++i) {
    bench_.pass(1);
    sum += bench_.model().analog_cv(input) / 100.0;
  }
  return sum / samples;
}

std::size_t SimulatedPerson::choice_of(const Question& question) const {
  const auto index_of = [&](const std::string& thing) {
    const auto found = std::find(question.choices.begin(), question.choices.end(), thing);
    return found == question.choices.end()
               ? std::size_t{0}
               : static_cast<std::size_t>(found - question.choices.begin());
  };
  if (question.check.starts_with("relay")) {
    const std::size_t needed = question.check == "relay 1" ? 1 : 2;
    return clicks_.size() < needed ? 0 : index_of("relay " + std::to_string(clicks_.back()));
  }
  for (const Seen& each : seen_) {
    if (index_of(each.thing) != 0) return index_of(each.thing);
  }
  return 0;
}

Answer SimulatedPerson::answer(const Question& question) {
  Answer answer;
  answer.yes = true;
  switch (question.topic) {
    case Topic::supply_off:
    case Topic::wheels_off_ground:
    case Topic::clear:
    case Topic::give_wiring:
    case Topic::give_settings:
      break;
    case Topic::restart:
      bench_.happen("reboot");
      for (std::int32_t& position : positions_) position = 0;
      bench_.pass(1500);
      break;
    case Topic::address_seen: {
      // The real address of the chip that the question names first.
      for (int i = signals::osmc_chip; i <= signals::dac_chip; ++i) {
        const Place true_place = bench_.model().chips().wiring.places[i];
        if (true_place == plan_wiring().places[i]) continue;
        answer.number = true_place.connected() ? true_place.number() : 0;
      }
      break;
    }
    case Topic::meter:
      answer.number = meter(analog_of(question.check));
      break;
    case Topic::handle_held:
    case Topic::handle_released:
      bench_.happen(question.topic == Topic::handle_held ? "handle held" : "handle released");
      bench_.pass(reaction_ms);
      break;
    case Topic::wheel_turned:
      for (int i = 1; i <= 1000; ++i) {
        const int encoder = number_in(question.check);
        bench_.model().turn_encoder(encoder, bench_.model().shaft_count(encoder) + 1);
        bench_.pass(1);
      }
      break;
    case Topic::hand_before_sensor:
      bench_.model().set_ultrasonic(number_in(question.check), 20);
      bench_.pass(reaction_ms);
      break;
    case Topic::hand_away:
      bench_.model().set_ultrasonic(number_in(question.check), 0);
      bench_.pass(reaction_ms);
      break;
    case Topic::baud:
      answer.number = 115200;
      break;
    case Topic::supply_with_relay_open:
      answer.yes = bench_.model().motors_have_supply();
      break;
    case Topic::supply_with_relay_closed:
      answer.yes = supplied_;
      break;
    case Topic::which:
      answer.choice = choice_of(question);
      break;
    case Topic::forward:
      answer.yes = !seen_.empty() && seen_.front().forward;
      break;
    case Topic::two_pwm_inputs: {
      const SignalKind kind =
          question.check.starts_with("osmc") ? SignalKind::osmc_pwm : SignalKind::dhb12_pwm;
      answer.yes = bench_.model().chips().wiring.at(kind, number_in(question.check)).option();
      break;
    }
    case Topic::servo_supply:
      answer.yes = !bench_.model().is_broken(sim::defects::servos);
      break;
  }
  return answer;
}

}  // namespace r4::simulation
