// SPDX-License-Identifier: GPL-3.0-or-later
// A person at a simulated board, who sees the movements of its motors, relays and servos, and
// answers accordingly.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "bench.hpp"
#include "r4link/commissioning/person.hpp"
#include "r4link/state.hpp"
#include "r4link/wiring/wiring.hpp"

namespace r4::simulation {

class SimulatedPerson final : public commissioning::Person {
 public:
  explicit SimulatedPerson(Bench& bench);

  void say(std::string_view check, std::string_view text) override;
  commissioning::Answer ask(const commissioning::Question& question) override;
  commissioning::Answer await_key(const commissioning::Movement& movement) override;
  bool holds_key() override;

  // If this function returns an answer, the answer replaces the usual answer.
  std::function<std::optional<commissioning::Answer>(const commissioning::Question&)> otherwise;
  std::optional<std::uint32_t> lets_go_after_ms;  // after the start of the next movement
  std::function<void()> before_key;  // called once, while the person reads about the next movement
  std::uint32_t hangs_ms = 0;        // how long holds_key() takes when it becomes false

  // How long a promise was broken, in milliseconds.
  int unannounced_ms = 0;  // an output was on, and nothing was announced
  int several_ms = 0;      // more than relay 1 and one other output was on
  int not_ended_ms = 0;    // an output was on 150 ms after the person released the key
  int movements = 0;

 private:
  struct Seen {
    std::string thing;  // "osmc 1"
    bool forward;
  };
  void look();
  void see(const std::string& thing, bool forward);
  commissioning::Answer answer(const commissioning::Question& question);
  std::size_t choice_of(const commissioning::Question& question) const;
  double meter(Analog input);

  Bench& bench_;
  bool moving_ = false;  // from the key to the next text
  bool holds_ = false;
  std::uint32_t held_since_ms_ = 0;
  std::uint32_t let_go_ms_ = 0;
  bool supplied_ = false;  // the motors had supply in the last movement
  std::vector<Seen> seen_;
  std::vector<int> clicks_;  // relays, in the order of closing
  std::uint8_t contacts_ = 0;
  std::int32_t positions_[stepper_channels] = {};
  std::int32_t shafts_[stepper_channels] = {};
};

}  // namespace r4::simulation
