// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <exception>

#include "r4link/control/loop.hpp"
#include "r4link/error.hpp"

namespace r4::control {
namespace {

using Clock = LoopGuard::Clock;
using Milliseconds = std::chrono::milliseconds;

constexpr std::size_t waiting_states = 8;  // a state may arrive in several datagrams
constexpr Milliseconds look_interval{20};  // period of checks of link and arming without a state

class StepWatchdog {
 public:
  StepWatchdog(Board& board, Milliseconds period) : board_(board), on_(period.count() > 0) {
    if (on_) board_.watchdog(period);
  }
  ~StepWatchdog() {
    if (on_) board_.watchdog(Milliseconds(0));
  }
  StepWatchdog(const StepWatchdog&) = delete;
  StepWatchdog& operator=(const StepWatchdog&) = delete;
  void feed() {
    if (on_) board_.feed();
  }

 private:
  Board& board_;
  bool on_;
};

DisarmCause cause_of(const Board& board, const LoopOptions& options) {
  return options.arming == Arming::off ? DisarmCause::none : board.disarmed_by();
}

// Sets the outputs to `rest`, or makes the board safe. Returns a text to append to `why`.
std::string come_to_rest(Board& board, const LoopOptions& options, bool& at_rest) {
  at_rest = true;
  const auto is_safe = [&] { return cause_of(board, options) != DisarmCause::none; };
  // After a disarming the outputs are already safe, and output commands are refused.
  if (is_safe() && board.disarmed_by() != DisarmCause::not_yet) return {};
  try {
    board.send(options.rest, options.rest_timeout);
    return {};
  } catch (const Error&) {
    if (is_safe()) return {};
  }
  try {
    board.stop(options.rest_timeout);
    return "; the board did not confirm that its motors are at rest, so it was stopped";
  } catch (const Error&) {
    at_rest = false;
    return "; the board did not confirm the stop: the stop is repeated, and without heartbeats the "
           "board goes safe; " +
           std::string(stop_last_resort);
  }
}

}  // namespace

LoopReport run_loop(Board& board, const LoopOptions& options,
                    const std::function<std::optional<Setpoints>(const LoopStep&)>& step) {
  if (options.rest.empty()) {
    throw Error(ErrorKind::usage, "LoopOptions::rest",
                "the group is empty, so the motors would keep their last setpoints",
                "add a setpoint of 0 for each motor of the loop");
  }
  LoopGuard guard(options);
  LoopReport report;
  std::exception_ptr thrown;
  board.setting("recovery", "rearm", std::chrono::seconds(1));
  {
    StepWatchdog watchdog(board, options.watchdog);
    States states = board.states({.most = waiting_states});
    guard.start(Clock::now());
    while (guard.check(board.link().state, cause_of(board, options), Clock::now()) ==
           LoopEnd::none) {
      watchdog.feed();
      const auto left = std::chrono::ceil<Milliseconds>(guard.deadline() - Clock::now());
      const auto state = states.take(std::clamp(left, Milliseconds(0), look_interval));
      if (!state) {
        if (states.ended()) guard.end(LoopEnd::not_active, "the board was closed");
        continue;
      }
      const auto dt_s = guard.on_state(*state, cause_of(board, options), Clock::now());
      if (!dt_s) continue;
      try {
        const std::optional<Setpoints> wanted = step({*state, *dt_s});
        if (!wanted) {
          guard.end(LoopEnd::asked, "the step function ended the loop");
          break;
        }
        ++report.steps;
        guard.on_commanded(*wanted);
        // A refused post needs no repeat: the next post is newer, and the guard checks the reason.
        if (!wanted->empty()) static_cast<void>(board.post(*wanted));
      } catch (...) {
        thrown = std::current_exception();
        break;
      }
    }
    report.end = guard.ended();
    report.why = guard.why() + come_to_rest(board, options, report.at_rest);
  }
  if (thrown) std::rethrow_exception(thrown);
  return report;
}

}  // namespace r4::control
