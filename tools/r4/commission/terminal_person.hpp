// SPDX-License-Identifier: GPL-3.0-or-later
// A person at a terminal with a keyboard. A terminal reports no release of a key, only its repeats.
// So the space bar counts as held from its first repeat until no repeat arrives for 150 ms.
#pragma once

#include <chrono>
#include <string>
#include <string_view>

#include "keyboard.hpp"
#include "r4link/commissioning/person.hpp"

namespace r4::tool {

class TerminalPerson final : public commissioning::Person {
 public:
  void say(std::string_view check, std::string_view text) override;
  commissioning::Answer ask(const commissioning::Question& question) override;
  commissioning::Answer await_key(const commissioning::Movement& movement) override;
  bool holds_key() override;

 private:
  using Clock = std::chrono::steady_clock;

  Keyboard keyboard_;
  Clock::time_point repeated_{};  // the newest repeat of the space bar
};

}  // namespace r4::tool
