// SPDX-License-Identifier: GPL-3.0-or-later
#include "simulated_hal.hpp"

#include <algorithm>
#include <iterator>

#include "random.hpp"

namespace r4 {
namespace sim {

namespace {

// A value of an analog input and how often it occurs.
struct Level {
  std::int16_t centivolts;
  std::uint8_t count;
};

// The capture's (paper section 4.4).
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
// An input that nothing drives, and that of a released handle.
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

}  // namespace

void SimulatedHal::power_on(std::uint32_t now_ms) {
  now_ms_ = now_ms;
  outputs_ = firmware::Outputs();
  std::fill(std::begin(steppers_), std::end(steppers_), Stepper());
  std::fill(std::begin(encoder_counts_), std::end(encoder_counts_), 0);
}

void SimulatedHal::advance(std::uint32_t now_ms) {
  const std::uint32_t passed_ms = now_ms - now_ms_;
  if (passed_ms == 0) return;
  now_ms_ = now_ms;
  for (int i = 0; i < stepper_channels; ++i) move(steppers_[i], outputs_.stepper[i], passed_ms);
}

void SimulatedHal::move(Stepper& stepper, const firmware::StepperTarget& target,
                        std::uint32_t passed_ms) {
  const std::int64_t distance = std::int64_t{target.position} - stepper.position;
  if (!target.enabled || distance == 0) {
    stepper.thousandths = 0;
    return;
  }
  const std::int64_t thousandths =
      stepper.thousandths + std::int64_t{target.speed} * std::int64_t{passed_ms};
  const std::int64_t steps = std::min(thousandths / 1000, distance < 0 ? -distance : distance);
  stepper.thousandths = static_cast<std::uint32_t>(thousandths % 1000);
  stepper.position = static_cast<std::int32_t>(stepper.position + (distance < 0 ? -steps : steps));
}

void SimulatedHal::pin_analog(Analog input, std::int32_t centivolts) {
  pinned_cv_[static_cast<int>(input)] = centivolts;
  pinned_ = static_cast<std::uint8_t>(pinned_ | 1U << static_cast<int>(input));
}

std::int32_t SimulatedHal::analog_cv(int input) const {
  if ((pinned_ >> input & 1) != 0) return pinned_cv_[input];
  const std::uint64_t random =
      scramble(seed_ ^ scramble(std::uint64_t{now_ms_} << 8 | static_cast<std::uint64_t>(input)));
  switch (static_cast<Analog>(input)) {
    case Analog::ain24:
      return pick(ain24, random);
    case Analog::ain12:
      return pick(ain12, random);
    case Analog::ain5:
      return pick(ain5, random);
    case Analog::aindmh:
      return handle_held_ ? pick(aindmh_held, random) : pick(near_zero, random);
    case Analog::ainsteer:
      return pick(ainsteer, random);
    case Analog::ain6:
    case Analog::count:
      break;
  }
  return pick(near_zero, random);
}

void SimulatedHal::sample(firmware::Inputs& inputs) {
  for (int i = 0; i < analog_channels; ++i) inputs.analog_cv[i] = analog_cv(i);
  inputs.handle_held = handle_held_;
  for (int i = 0; i < stepper_channels; ++i) inputs.stepper_steps[i] = steppers_[i].position;
  std::copy(std::begin(encoder_counts_), std::end(encoder_counts_), inputs.encoder_counts);
  std::copy(std::begin(ultrasonic_cm_), std::end(ultrasonic_cm_), inputs.ultrasonic_cm);
}

void SimulatedHal::zero(int channel) {
  encoder_counts_[channel - 1] = 0;
  steppers_[channel - 1] = Stepper();
  outputs_.stepper[channel - 1].enabled = false;
}

}  // namespace sim
}  // namespace r4
