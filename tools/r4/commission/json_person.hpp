// SPDX-License-Identifier: GPL-3.0-or-later
// A person who answers through a script: JSON lines of questions on stdout, of answers on stdin.
//     {"type":"question","check":"osmc 1","topic":"which","text":…,"answer":"choice","choices":[…]}
//         {"answer":"osmc 1"}   a choice, a number, or true or false
//         {"action":"skip"}     or repeat, leave: to any question, and in place of the key
//     {"type":"movement","check":"osmc 1","text":…,"command":"O:410,0,1","milliseconds":500}
//         {"key":true}          something may move, until {"key":false} or the end of the input
#pragma once

#include <string>
#include <string_view>

#include "../shell/json.hpp"
#include "keyboard.hpp"
#include "r4link/commissioning/person.hpp"

namespace r4::tool {

class JsonPerson final : public commissioning::Person {
 public:
  void say(std::string_view check, std::string_view text) override;
  commissioning::Answer ask(const commissioning::Question& question) override;
  commissioning::Answer await_key(const commissioning::Movement& movement) override;
  bool holds_key() override;

 private:
  // The next line as an object; null: no line arrived in time; at the end: {"action":"leave"}.
  Json next_line(std::chrono::milliseconds timeout);

  Keyboard keyboard_;
  std::string line_;
  bool key_ = false;
};

}  // namespace r4::tool
