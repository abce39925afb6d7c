// SPDX-License-Identifier: GPL-3.0-or-later
#include "arming.hpp"

namespace r4 {

namespace {

constexpr std::uint8_t bit(SafeReason reason) {
  return static_cast<std::uint8_t>(1U << static_cast<unsigned>(reason));
}

struct Meaning {
  DisarmCause cause = DisarmCause::none;
  // For a reason that only E:CLEAR ends: the cause if it may be older than the session or the boot.
  DisarmCause earlier = DisarmCause::none;
  // The reasons that only E:CLEAR ends, and that may hold while the board reports this reason. The
  // board reports the gravest reason: a stop, then a fault, a watchdog, and the other reasons.
  std::uint8_t may_hold = 0;
};

Meaning meaning_of(SafeReason reason) {
  constexpr std::uint8_t from_watchdog = bit(SafeReason::watchdog);
  constexpr std::uint8_t from_fault = bit(SafeReason::fault) | from_watchdog;
  constexpr std::uint8_t from_stop = bit(SafeReason::stop) | from_fault;
  switch (reason) {
    case SafeReason::stop:
      return {DisarmCause::stop, DisarmCause::earlier_stop, from_stop};
    case SafeReason::fault:
      return {DisarmCause::fault, DisarmCause::earlier_fault, from_fault};
    case SafeReason::watchdog:
      return {DisarmCause::watchdog, DisarmCause::earlier_watchdog, from_watchdog};
    case SafeReason::handle:
      return {DisarmCause::handle};
    case SafeReason::proximity:
      return {DisarmCause::proximity};
    case SafeReason::none:
    case SafeReason::link:
      break;
  }
  return {};
}

}  // namespace

// The first cause is kept until the next arm(), because later causes follow from it.
void ArmingMachine::disarm(DisarmCause cause) {
  if (cause == DisarmCause::restart) {
    earlier_ = static_cast<std::uint8_t>(earlier_ | bit(SafeReason::fault));
  }
  if (armed() || cause_ == DisarmCause::not_yet) cause_ = cause;
}

bool ArmingMachine::on_reason(SafeReason reason) {
  const DisarmCause cause = meaning_of(reason).cause;
  const bool closing = attempt_ == Attempt::closing;
  if (cause == DisarmCause::none || (!armed() && !closing)) return false;
  cause_ = cause;
  return closing;
}

void ArmingMachine::on_heard(SafeReason reason) {
  earlier_ = static_cast<std::uint8_t>(earlier_ & meaning_of(reason).may_hold);
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
  if (reason == SafeReason::none) return Step::close;
  const Meaning meaning = meaning_of(reason);
  if ((earlier_ & meaning.may_hold & bit(reason)) != 0) return fail(meaning.earlier);
  const bool may_clear = meaning.earlier != DisarmCause::none && (cleared_ & bit(reason)) == 0 &&
                         (first || reason != SafeReason::stop);
  if (!may_clear) return fail(meaning.cause);
  cleared_ = static_cast<std::uint8_t>(cleared_ | bit(reason));
  return Step::clear;
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
