// SPDX-License-Identifier: GPL-3.0-or-later
#include "checking.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "r4link/error.hpp"

namespace r4::commissioning {
namespace {

using namespace std::chrono_literals;

constexpr Duration turn = 20ms;          // how often a held key is checked
constexpr Duration longest_gap = 200ms;  // without a state or an answer during a movement
constexpr int most_tries = 3;
constexpr std::string_view supply = "motor supply";

// Unless the movement was ended in order, stops the board. No heartbeat is sent before the board
// has confirmed the stop: with recovery=last a heartbeat would restore the outputs.
class StopUnlessEnded {
 public:
  explicit StopUnlessEnded(BoardUnderTest& board) : board_(board) { board.supervise(true); }
  StopUnlessEnded(const StopUnlessEnded&) = delete;
  StopUnlessEnded& operator=(const StopUnlessEnded&) = delete;
  ~StopUnlessEnded() {
    if (ended_) return;
    try {
      board_.be_silent(true);
      board_.stop();
      end();
      board_.be_silent(false);
    } catch (...) {  // without heartbeats the board goes safe by its timeout
    }
  }
  void end() {
    board_.supervise(false);
    ended_ = true;
  }

 private:
  BoardUnderTest& board_;
  bool ended_ = false;
};

}  // namespace

Answer Checking::ask(Question question) {
  question.check = check.id;
  Answer answer = person_.ask(question);
  if (answer.kind != Answer::Kind::given) throw Ended{answer.kind};
  return answer;
}

bool Checking::confirms(Topic topic, std::string text) {
  Question question{topic};
  question.text = std::move(text);
  return ask(std::move(question)).yes;
}

void Checking::require(Topic topic, std::string text, const char* otherwise) {
  if (!confirms(topic, std::move(text))) give_up(Status::not_done, otherwise);
}

void Checking::require_connected(Topic topic, std::string text) {
  if (!confirms(topic, std::move(text))) give_up(Status::skipped, "nothing is connected");
}

double Checking::number(Topic topic, std::string text, std::string unit) {
  Question question{topic, Question::Kind::number};
  question.text = std::move(text);
  question.unit = std::move(unit);
  return ask(std::move(question)).number;
}

std::optional<Thing> Checking::which(Thing commanded, std::string text) {
  const std::vector<Thing> things = alike(commanded.first);
  Question question{Topic::which, Question::Kind::choice};
  question.text = std::move(text);
  question.choices = {"nothing", "not connected"};
  for (const Thing& thing : things) question.choices.push_back(name_of(thing));
  const std::size_t chosen = ask(question).choice;
  if (chosen == 0) return std::nullopt;
  if (chosen == 1) give_up(Status::skipped, "nothing is connected");
  const Thing seen = things.at(chosen - 2);
  if (seen != commanded) learnt_exchange(commanded, seen);
  return seen;
}

void Checking::send(const Command& command) { board.send(command, 1s); }

void Checking::drive(const Command& command) { board.send(command, longest_gap); }

void Checking::select_fields(const std::string& names) {
  send(Command::fields(Text(names)));
  board.forget_states();  // earlier states report 0 for a new field
}

std::vector<ReceivedState> Checking::states_since_forget() { return collect(0ms); }

std::vector<ReceivedState> Checking::collect(Duration time) {
  std::vector<ReceivedState> states;
  std::uint32_t began_ms = 0;
  for (;;) {
    const auto state = board.next_state(time == 0ms ? 0ms : 1s);
    if (!state) {
      if (time == 0ms) return states;
      if (!states.empty() && board.link().reason == SafeReason::link) return states;
      throw Error(explain(check.id, board.link()));
    }
    if (states.empty()) began_ms = state->t_ms;
    states.push_back(*state);
    if (time != 0ms && Duration(state->t_ms - began_ms) >= time) return states;
  }
}

BoardWiring Checking::wiring_after_restart() {
  require(Topic::restart,
          "Press the reset button of the board, and confirm when its light is on again.",
          "the board was not restarted");
  for (int tries = 0;; ++tries) {
    board.wait_heard();
    try {
      return board.wiring();
    } catch (const Error& error) {  // the board is starting
      if (error.kind() != ErrorKind::refused || tries == most_tries) throw;
    }
  }
}

// Asks the person, then clears the cause. False if E:CLEAR does not clear this kind of cause.
bool Checking::clear_cause(const LinkStatus& link) {
  const bool unconfirmed =
      link.reason == SafeReason::fault && link.chip.trouble == ChipTrouble::not_confirmed;
  if (!unconfirmed && link.reason != SafeReason::stop && link.reason != SafeReason::watchdog) {
    return false;
  }
  require(Topic::clear,
          unconfirmed ? "The wiring of this board is not confirmed, so the board keeps its outputs "
                        "off. A command may move another output than it names. May this program "
                        "clear the fault (E:CLEAR) until the board's next start?"
                      : fmt::format("The board is in the safe state: {}. May this program clear "
                                    "the safe state (E:CLEAR)?",
                                    to_text(link.reason)),
          "the safe state was not cleared");
  send(Command::clear());
  return true;
}

void Checking::make_ready() {
  if (has_found(report, "handle")) {
    give_up(Status::not_done, "the check needs a correct dead-man's handle");
  }
  if (check.section == Section::wheels_off_ground && check.id != supply &&
      has_found(report, supply)) {
    give_up(Status::not_done, "the check needs a correct motor supply");
  }
  for (int tries = 0;; ++tries) {
    board.wait_heard();
    const LinkStatus link = board.link();
    if (link.state == HostLinkState::active) return;
    if (link.reason == SafeReason::link && tries != most_tries) {  // the board has not answered yet
      collect(100ms);
      continue;
    }
    if (link.reason == SafeReason::handle && tries != most_tries) {
      require(Topic::handle_held, "Hold the dead-man's handle, and keep holding it.",
              "the handle is released");
      collect(100ms);
      continue;
    }
    if (tries != most_tries && clear_cause(link)) {
      collect(50ms);
      continue;
    }
    std::string why = fmt::format("the board is in the safe state: {}", to_text(link.reason));
    if (link.chip.any()) why += fmt::format(", {}", to_text(link.chip.trouble));
    give_up(Status::not_done, std::move(why));
  }
}

void Checking::hold(const Movement& movement, const std::optional<Command>& rest,
                    const std::function<void()>& act) {
  do {  // repeat if the board went safe meanwhile, because arm() would clear a stop
    make_ready();
    const Answer answer = person_.await_key(movement);
    if (answer.kind != Answer::Kind::given) throw Ended{answer.kind};
  } while (board.link().state != HostLinkState::active);
  StopUnlessEnded guard(board);
  board.arm();
  board.forget_states();
  act();
  const SafeReason reason = board.link().reason;
  // With recovery=last the next heartbeat would restore the outputs, so the guard stops the board.
  if (reason == SafeReason::link) return;
  if (reason == SafeReason::none) {  // else all outputs are off
    if (rest) drive(*rest);
    drive(Command::relay(1, false));
  }
  guard.end();
}

bool Checking::watch(ReceivedState& state) {
  for (Duration waited = 0ms; waited < longest_gap; waited += turn) {
    if (!person_.holds_key()) return false;
    if (const auto next = board.next_state(turn)) {
      state = *next;
      return state.safe == SafeReason::none;
    }
  }
  throw Error(ErrorKind::refused, check.id, "the board's states stopped during a movement",
              "check the link, and resume");
}

void Checking::move(const std::string& text, const Command& command,
                    const std::optional<Command>& rest, Duration most,
                    const std::function<void(const ReceivedState&)>& on_state) {
  for (int tries = 0; tries < most_tries; ++tries) {
    Duration moved = 0ms;
    hold({check.id, text, command, most}, rest, [&] {
      ReceivedState state;
      if (!watch(state)) return;
      if (rest) drive(*rest);
      drive(command);
      board.forget_states();
      std::optional<std::uint32_t> began_ms;
      while (moved < most && watch(state)) {
        if (!began_ms) began_ms = state.t_ms;
        moved = Duration(state.t_ms - *began_ms);
        if (on_state) on_state(state);
      }
    });
    if (moved >= most) return;
    say("That was too short to see: hold the key until the movement has ended.");
  }
  give_up(Status::not_done, "each attempt ended before the movement was complete");
}

void Checking::measured(std::string what, double value, std::string unit) {
  result_.measured.push_back({std::move(what), value, std::move(unit)});
}

void Checking::found(Finding finding, std::string detail) {
  found_at(check.id, finding, std::move(detail));
}

void Checking::found_at(std::string thing, Finding finding, std::string detail) {
  result_.found.push_back({finding, std::move(thing), std::move(detail)});
}

void Checking::learnt_exchange(Thing places_of, Thing served) {
  const std::string first = name_of(places_of);
  found(Finding::exchanged, (first == check.id ? name_of(served) : first) + " instead");
  learnt({Learnt::What::serves, places_of.signal(), served.signal(), {}, 1});
}

void Checking::give_up(Status status, std::string note) { throw NotDone{status, std::move(note)}; }

bool has_found(const Report& report, std::string_view check) {
  return std::any_of(report.checks.begin(), report.checks.end(), [&](const CheckResult& result) {
    return result.id == check && !result.found.empty();
  });
}

}  // namespace r4::commissioning
