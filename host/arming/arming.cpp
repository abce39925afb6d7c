// SPDX-License-Identifier: GPL-3.0-or-later
#include "arming.hpp"

namespace r4 {

namespace {

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

DisarmCause earlier_cause_of(SafeReason reason) {
  switch (reason) {
    case SafeReason::stop:
      return DisarmCause::earlier_stop;
    case SafeReason::watchdog:
      return DisarmCause::earlier_watchdog;
    default:
      return DisarmCause::earlier_fault;
  }
}

}  // namespace

// The first cause is kept until the next arm(), because later causes follow from it.
void ArmingMachine::disarm(DisarmCause cause) {
  if (cause == DisarmCause::restart) {
    earlier_ = static_cast<std::uint8_t>(earlier_ | bit(SafeReason::fault));
  }
  if (armed() || cause_ == DisarmCause::not_yet) cause_ = cause;
}

void ArmingMachine::on_reason(SafeReason reason) {
  const DisarmCause cause = cause_of(reason);
  if (cause != DisarmCause::none && armed()) cause_ = cause;
}

// The board reports its gravest reason. A reason that only E:CLEAR ends may hide other reasons.
void ArmingMachine::on_heard(SafeReason reason) {
  switch (reason) {
    case SafeReason::stop:
      break;
    case SafeReason::fault:
      earlier_ = static_cast<std::uint8_t>(earlier_ & ~bit(SafeReason::stop));
      break;
    case SafeReason::watchdog:
      earlier_ = static_cast<std::uint8_t>(earlier_ & bit(SafeReason::watchdog));
      break;
    case SafeReason::none:
    case SafeReason::link:
    case SafeReason::handle:
    case SafeReason::proximity:
      earlier_ = 0;
      break;
  }
}

void ArmingMachine::on_sleep() {
  disarm(DisarmCause::sleep);
  earlier_ = 0xFF;
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
      if ((earlier_ & bit(reason)) != 0) return fail(earlier_cause_of(reason));
      const bool may_clear = (cleared_ & bit(reason)) == 0 && (first || reason != SafeReason::stop);
      cleared_ = static_cast<std::uint8_t>(cleared_ | bit(reason));
      if (may_clear) return Step::clear;
      break;
    }
    case SafeReason::link:
    case SafeReason::handle:
    case SafeReason::proximity:
      break;
  }
  return fail(cause_of(reason));
}

ArmingMachine::Step ArmingMachine::fail(DisarmCause cause) {
  cause_ = cause;
  attempt_ = Attempt::none;
  return Step::fail;
}

void ArmingMachine::on_closed() {
  attempt_ = Attempt::none;
  outage_ = false;
  cause_ = DisarmCause::none;
}

}  // namespace r4
