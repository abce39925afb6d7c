// SPDX-License-Identifier: GPL-3.0-or-later
// The calls of arm() that have not ended, and whether the program may drive outputs. Without I/O.
//     add() --> waiting --in control, and no stop, E:CLEAR or step is under way--> next_step()
//                  ^                                                                  |
//                  +---- the board has executed the step (E:CLEAR or R:1,On) ---------+
//
//     A call ends confirmed when the program is armed; refused when the board refuses a step;
//     not_armed when arming is impossible, or a cause is newer than the call; timed_out, cancelled
//     and closed like a command.
//
// Several calls share the steps, and end together. Later output commands wait for the end.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "../link/effects.hpp"
#include "../link/heard_board.hpp"
#include "arming.hpp"
#include "r4link/command.hpp"
#include "r4link/link.hpp"

namespace r4 {

class ArmRequests {
 public:
  static constexpr std::size_t max_requests = 64;

  ArmRequests(Arming mode, Effects& effects, Statistics& counts)
      : mode_(mode), effects_(effects), counts_(counts) {}

  bool may_drive() const { return mode_ == Arming::off || machine_.armed(); }
  DisarmCause cause() const { return machine_.cause(); }

  // `cause`: number of the newest known cause, or unnamed_cause. False if max_requests calls wait.
  bool add(Ticket ticket, std::int32_t cause, Time deadline, Time now);
  bool any() const { return !requests_.empty(); }
  // The ticket of the oldest call; without a call, greater than any ticket.
  Ticket first() const { return requests_.empty() ? no_ticket : requests_.front().ticket; }
  void end(Outcome outcome, Refusal code, Time now);
  bool cancel(Ticket ticket, Time now);
  void expire(Time now);
  Time next_deadline() const;
  // The number of the newest cause that only E:CLEAR ends; 0 if there is none.
  void on_cause(std::int32_t newest, Time now);

  // True, once, if all requests ended during a step: the caller then drops the step.
  bool take_abandoned() { return std::exchange(abandoned_, false); }
  // Call next_step() while the board obeys and no step runs. `reason`: why the outputs are off.
  std::optional<Command> next_step(SafeReason reason, Time now);
  // The step has ended. `supply_open`: the board's states show that relay 1 is open.
  void on_step(CommandKind kind, const CommandResult& result, SafeReason reason, bool supply_open,
               Time now);

  void disarm(DisarmCause cause);
  void on_sleep() { machine_.on_sleep(); }
  void begin_anew();
  void on_link(bool up, bool in_control, bool safe, SafeReason reason, Time now);
  void on_supply(bool closed) { machine_.on_supply(closed); }
  void report();

 private:
  struct Request {
    Ticket ticket = 0;
    std::int32_t cause = Command::unnamed_cause;
    Time started{0};
    Time deadline{0};
  };
  static constexpr Ticket no_ticket = std::numeric_limits<Ticket>::max();

  template <class Predicate>
  bool end_those(Predicate which, Outcome outcome, Refusal code, Time now);

  const Arming mode_;
  Effects& effects_;
  Statistics& counts_;
  ArmingMachine machine_;
  DisarmCause told_ = DisarmCause::not_yet;
  std::vector<Request> requests_;
  bool abandoned_ = false;
};

}  // namespace r4
