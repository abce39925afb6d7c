// SPDX-License-Identifier: GPL-3.0-or-later
#include "arming.hpp"

namespace r4 {

const char* to_text(DisarmCause cause) {
  switch (cause) {
    case DisarmCause::none:
      return "none";
    case DisarmCause::not_yet:
      return "not yet";
    case DisarmCause::stop:
      return "stop";
    case DisarmCause::handle:
      return "handle";
    case DisarmCause::proximity:
      return "proximity";
    case DisarmCause::watchdog:
      return "watchdog";
    case DisarmCause::fault:
      return "fault";
    case DisarmCause::link:
      return "link";
    case DisarmCause::restart:
      return "restart";
    case DisarmCause::supply:
      return "supply";
  }
  return "unknown";
}

DisarmCause cause_of(SafeReason reason) {
  switch (reason) {
    case SafeReason::stop:
      return DisarmCause::stop;
    case SafeReason::handle:
      return DisarmCause::handle;
    case SafeReason::proximity:
      return DisarmCause::proximity;
    case SafeReason::watchdog:
      return DisarmCause::watchdog;
    case SafeReason::fault:
      return DisarmCause::fault;
    case SafeReason::none:
    case SafeReason::link:
      break;
  }
  return DisarmCause::none;
}

// The first cause is told until the next arm(): what follows from it is no news.
void ArmingMachine::disarm(DisarmCause cause) {
  if (armed() || cause_ == DisarmCause::not_yet) cause_ = cause;
}

void ArmingMachine::on_reason(SafeReason reason) {
  const DisarmCause cause = cause_of(reason);
  if (cause != DisarmCause::none && armed()) cause_ = cause;
}

void ArmingMachine::on_supply(bool closed) {
  if (!armed()) return;
  if (!closed) cause_ = outage_ ? DisarmCause::link : DisarmCause::supply;
  outage_ = false;
}

void ArmingMachine::begin() {
  attempt_ = Attempt::begun;
  cleared_ = 0;
}

ArmingMachine::Step ArmingMachine::next(SafeReason reason) {
  if (reason == SafeReason::link) return Step::wait;
  const bool first = attempt_ == Attempt::begun;
  attempt_ = reason == SafeReason::none ? Attempt::closing : Attempt::clearing;
  switch (reason) {
    case SafeReason::none:
      return Step::close;
    case SafeReason::stop:
    case SafeReason::watchdog:
    case SafeReason::fault: {
      const auto bit = static_cast<std::uint8_t>(1U << static_cast<unsigned>(reason));
      const bool may_clear = (cleared_ & bit) == 0 && (first || reason != SafeReason::stop);
      cleared_ = static_cast<std::uint8_t>(cleared_ | bit);
      if (may_clear) return Step::clear;
      break;
    }
    case SafeReason::link:
    case SafeReason::handle:
    case SafeReason::proximity:
      break;
  }
  cause_ = cause_of(reason);
  attempt_ = Attempt::none;
  return Step::fail;
}

void ArmingMachine::on_closed() {
  attempt_ = Attempt::none;
  outage_ = false;
  cause_ = DisarmCause::none;
}

}  // namespace r4
