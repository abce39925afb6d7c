// SPDX-License-Identifier: GPL-3.0-or-later
// A running check: its person, its board and its result. A function that ends the check early
// throws Ended or NotDone, which Commissioning::run() catches.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "r4link/commissioning/commissioning.hpp"
#include "things.hpp"

namespace r4::commissioning {

using Duration = BoardUnderTest::Duration;

// The person skips, repeats or leaves.
struct Ended {
  Answer::Kind kind;
};
struct NotDone {
  Status status;
  std::string note;
};

class Checking {
 public:
  Checking(BoardUnderTest& tested, Person& person, const Check& its_check, const Report& so_far,
           CheckResult& result)
      : board(tested), report(so_far), check(its_check), person_(person), result_(result) {}

  void say(std::string_view text) { person_.say(check.id, text); }
  bool confirms(Topic topic, std::string text);
  // Unless the person confirms, ends the check with the note `otherwise`.
  void require(Topic topic, std::string text, const char* otherwise);
  // As require(), but the answer no skips the check: nothing is connected.
  void require_connected(Topic topic, std::string text);
  double number(Topic topic, std::string text, std::string unit);
  // The thing that moved or clicked; no value if nothing did. Gives up if nothing is connected.
  std::optional<Thing> which(Thing commanded, std::string text);

  void send(const Command& command);
  // Commands the moving output. The key is not checked meanwhile, so this takes at most 200 ms.
  void drive(const Command& command);
  void select_fields(const std::string& names);
  std::vector<ReceivedState> states_since_forget();
  std::vector<ReceivedState> collect(Duration time);
  // The wiring that the board keeps after the person has pressed reset.
  BoardWiring wiring_after_restart();
  // Brings the board out of the safe state, or gives up.
  void make_ready();
  // Moves an output until `most` has passed, then sets it to `rest`, if any, and opens relay 1.
  void move(const std::string& text, const Command& command, const std::optional<Command>& rest,
            Duration most, const std::function<void(const ReceivedState&)>& on_state = {});
  // Calls `act` with relay 1 closed and the key held, then sets the output to `rest`, if any, and
  // opens relay 1. When watch() is false or the movement has ended, `act` must return.
  void hold(const Movement& movement, const std::optional<Command>& rest,
            const std::function<void()>& act);
  // Waits for the next state while something moves. False if the person released the key, or the
  // board went safe. Throws Error if no state arrives.
  bool watch(ReceivedState& state);

  void measured(std::string what, double value, std::string unit);
  void found(Finding finding, std::string detail = {});
  void found_at(std::string thing, Finding finding, std::string detail = {});
  void learnt(const Learnt& learnt) { result_.learnt.push_back(learnt); }
  // Adds the finding, and learns that the places of `places_of` serve `served`.
  void learnt_exchange(Thing places_of, Thing served);
  void note(std::string text) { result_.note = std::move(text); }
  [[noreturn]] static void give_up(Status status, std::string note);

  BoardUnderTest& board;
  const Report& report;
  const Check& check;

 private:
  Answer ask(Question question);
  bool clear_cause(const LinkStatus& link);

  Person& person_;
  CheckResult& result_;
};

bool has_found(const Report& report, std::string_view check);

}  // namespace r4::commissioning
