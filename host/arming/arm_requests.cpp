// SPDX-License-Identifier: GPL-3.0-or-later
#include "arm_requests.hpp"

#include <algorithm>

namespace r4 {

bool ArmRequests::add(Ticket ticket, std::int32_t cause, Time deadline, Time now) {
  if (requests_.size() == max_requests) return false;
  requests_.push_back({ticket, cause, now, deadline});
  if (!machine_.under_way()) machine_.begin();
  return true;
}

template <class Predicate>
bool ArmRequests::end_those(Predicate which, Outcome outcome, Refusal code, Time now) {
  const std::size_t ended = std::erase_if(requests_, [&](const Request& each) {
    if (!which(each)) return false;
    const DisarmCause disarmed = outcome == Outcome::not_armed ? cause() : DisarmCause::none;
    effects_.end(each.ticket, {outcome, code, now - each.started, disarmed}, counts_);
    return true;
  });
  if (requests_.empty() && machine_.under_way()) {
    machine_.give_up();
    abandoned_ = true;
  }
  return ended != 0;
}

void ArmRequests::end(Outcome outcome, Refusal code, Time now) {
  end_those([](const Request&) { return true; }, outcome, code, now);
}

bool ArmRequests::cancel(Ticket ticket, Time now) {
  return end_those([ticket](const Request& each) { return each.ticket == ticket; },
                   Outcome::cancelled, Refusal::none, now);
}

void ArmRequests::expire(Time now) {
  end_those([now](const Request& each) { return now >= each.deadline; }, Outcome::timed_out,
            Refusal::none, now);
}

Time ArmRequests::next_deadline() const {
  Time next = Time::max();
  for (const Request& each : requests_) next = std::min(next, each.deadline);
  return next;
}

// A cause that is newer than the call of arm() ends the call: the program must decide again.
void ArmRequests::on_cause(std::int32_t newest, Time now) {
  for (Request& each : requests_) {
    if (each.cause == Command::unnamed_cause) each.cause = newest;
  }
  const bool any = std::any_of(requests_.begin(), requests_.end(), [newest](const Request& each) {
    return newest != 0 && newest != each.cause;
  });
  if (any) end(Outcome::not_armed, Refusal::none, now);
}

std::optional<Command> ArmRequests::next_step(SafeReason reason, Time now) {
  if (requests_.empty()) return {};
  if (machine_.armed()) {
    end(Outcome::confirmed, Refusal::none, now);
    return {};
  }
  switch (machine_.next(reason)) {
    case ArmingMachine::Step::wait:
      break;
    case ArmingMachine::Step::clear:
      return Command::clear();
    case ArmingMachine::Step::close:
      return Command::relay(HeardBoard::supply_relay, true);
    case ArmingMachine::Step::fail:
      end(Outcome::not_armed, Refusal::none, now);
      break;
  }
  return {};
}

// A confirmed E:CLEAR changes nothing here, because next_step() checks the board's reason. Steps
// are cancelled only when their requests end.
void ArmRequests::on_step(CommandKind kind, const CommandResult& result, SafeReason reason,
                          bool supply_open, Time now) {
  if (requests_.empty()) return;
  if (result.outcome == Outcome::refused) end(result.outcome, result.code, now);
  if (result.outcome != Outcome::confirmed || kind != CommandKind::relay) return;
  if (reason != SafeReason::none || supply_open) return;
  machine_.on_closed();
  report();
}

void ArmRequests::disarm(DisarmCause cause) {
  machine_.disarm(cause);
  report();
}

// A reason from before the control of this session may be older than the session.
void ArmRequests::on_link(bool up, bool in_control, bool safe, SafeReason reason, Time now) {
  if (!up) machine_.on_outage();
  if (in_control) machine_.on_heard(reason);
  if (safe && machine_.on_reason(reason)) end(Outcome::not_armed, Refusal::none, now);
  report();
}

void ArmRequests::begin_anew() {
  machine_ = ArmingMachine();
  report();
}

void ArmRequests::report() {
  if (told_ == machine_.cause()) return;
  told_ = machine_.cause();
  effects_.report(told_);
}

}  // namespace r4
