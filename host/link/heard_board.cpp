// SPDX-License-Identifier: GPL-3.0-or-later
#include "heard_board.hpp"

#include <algorithm>

namespace r4 {

namespace {

// Estimating the board's clock needs more questions than identify_interval gives: first until the
// error is small, later whenever the error has grown. The interval is not a whole number of
// milliseconds, so the answers also show where a millisecond of the board's clock begins.
constexpr Time soon_interval{102'300};
constexpr Time first_goal{500}, later_goal{1'000};
constexpr int first_questions = 100, questions_in_vain = 10;

}  // namespace

void HeardBoard::on_heartbeat(SafeReason reason, std::optional<std::uint32_t> t_ms, Time now) {
  if (t_ms) clock_.heard(*t_ms, now);
  state_.safe = reason;
  state_.reported.add(StateField::safe);
  if (reason == SafeReason::none) state_.fault = ChipFault();
}

void HeardBoard::on_state(const ReceivedState& state, std::optional<SafeReason> reason, Time now) {
  const SafeReason told = reason.value_or(state_.safe);
  state_ = state;
  state_.reported.add(state.present);
  clock_.heard(state_.t_ms, now);
  const BoardClock::Instant sampled = clock_.at(state_.t_ms);
  state_.sampled = ReceivedState::Clock::time_point(sampled.at);
  state_.sampled_error = sampled.error ? *sampled.error : ReceivedState::unknown;
  state_.received = ReceivedState::Clock::time_point(now);
  state_.safe = told;
  // During a fault, every state has the field.
  if (reason && !state_.present.has(StateField::fault)) state_.fault = ChipFault();
}

std::optional<Time> HeardBoard::on_identity(const Identity& identity, std::uint32_t t_ms,
                                            Time now) {
  knows_leave_ = has_capability(identity.capabilities, leave_capability);
  groups_.on_identity(identity.capabilities);
  const std::optional<Time> asked = question_.answered(identity);
  if (asked) {
    clock_.heard(t_ms, now);
    if (identity.has_asked) clock_.answered(t_ms, *asked);
  }
  return asked;
}

void HeardBoard::on_restart() {
  knows_leave_.reset();
  state_ = ReceivedState();
  clock_.restart();
  questions_of_clock_ = 0;
  groups_.on_restart();
}

std::optional<bool> HeardBoard::supply() const {
  if (state_.safe != SafeReason::none || !state_.present.has(StateField::relays)) return {};
  return supply_closed();
}

void HeardBoard::ask(std::uint32_t pnum, Time now) {
  next_question_ = now + identify_interval_;
  asked(pnum, now);
  ++questions_of_clock_;
}

Time HeardBoard::next_question() const {
  if (identify_interval_.count() == 0) return Time::max();
  const bool first = questions_of_clock_ < first_questions;
  const bool known = state_.sampled_error != ReceivedState::unknown;
  const Time enough = first ? first_goal : later_goal;
  const bool soon = known ? state_.sampled_error > enough : questions_of_clock_ < questions_in_vain;
  return std::min(next_question_, newest_question_ + (soon ? soon_interval : identify_interval_));
}

}  // namespace r4
