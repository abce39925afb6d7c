// SPDX-License-Identifier: GPL-3.0-or-later
#include "commands_under_way.hpp"
#include "r4link/tables/commands.hpp"
#include "r4link/tables/state_fields.hpp"
#include "r4link/wiring/wiring_value.hpp"

namespace r4 {

namespace {

// Proof for boards without CMD. False without a state field (threshold, fields, settings).
bool state_shows(const State& state, const Command& command) {
  if (command.kind == CommandKind::relay) {
    return state.present.has(StateField::relays) && state.relay(command.channel) == command.on;
  }
  const StateField field = state_field(shown_by(command.kind), command.channel);
  if (!state.present.has(field)) return false;
  const StateNumbers numbers = numbers_of(state, field);  // value, direction, brake
  return numbers[0] == command.value &&
         (numbers.count < 2 || numbers[1] == static_cast<double>(command.direction)) &&
         (numbers.count < 3 || numbers[2] == static_cast<double>(command.on));
}

}  // namespace

void CommandsUnderWay::on_state(Time now) {
  const ReceivedState& state = board_.state();
  const FieldSelection& fields = keeper_.fields();
  for (Pending& pending : pending_.under_way()) {
    if (!pending.is_out() || pending.kind == CommandKind::stop || is_question(pending.kind) ||
        pending.kind == CommandKind::leave) {
      continue;
    }
    if (board_.confirms()) {
      const bool exact = state.last_command == pending.pnum;
      const bool past = newer(state.last_command, pending.pnum);
      if (exact || (past && pending.stage == Stage::executed)) {
        finish(pending, Outcome::confirmed, Refusal::none, now);
      } else if (past && pending.stage == Stage::sent) {
        pending.stage = Stage::overtaken;
        pending.retry = now;  // at once: the answer to the retry decides
      }
    } else if (!fields.answers() && fields.stage() != FieldSelection::Stage::asking &&
               state_shows(state, pending.command)) {
      finish(pending, Outcome::confirmed, Refusal::none, now);
    }
  }
}

void CommandsUnderWay::on_stop(const SafeReport& report, Time now) {
  if (report.reason != SafeReason::stop || !report.has_stop) return;
  for (Pending& pending : pending_.under_way()) {
    if (pending.kind != CommandKind::stop || report.stop != pending.pnum) continue;
    if (pending.is_out()) {
      finish(pending, Outcome::confirmed, Refusal::none, now);
    } else {
      pending.deadline = std::min(pending.deadline, now + options_.stop_linger);
    }
  }
}

// After a farewell the board is safe with the reason `link` or a graver reason. A heartbeat from
// before the farewell proves nothing: then the answer to a repetition ends the farewell.
void CommandsUnderWay::on_heartbeat(const SafeReport& report, std::optional<std::uint32_t> t_ms,
                                    Time now) {
  on_stop(report, now);
  cause_ = report.cause;
  const bool left = report.reason == SafeReason::link && (!t_ms || is_after_farewell(*t_ms));
  for (Pending& pending : pending_.under_way()) {
    if (pending.kind == CommandKind::leave && left) {
      finish(pending, Outcome::confirmed, Refusal::none, now);
    }
    if (pending.kind != CommandKind::clear || !name_cause(pending)) continue;
    if (cause_ != 0 && cause_ != pending.cause) {
      finish(pending, Outcome::cancelled, Refusal::none, now);
    }
  }
}

// True if T is from after the farewell. A state of the same millisecond may be older. On a slow
// network the board's clock has a large error: then T must be later with certainty.
bool CommandsUnderWay::is_after_farewell(std::uint32_t t_ms) const {
  constexpr Time fast{5000};
  constexpr Time tick{1000};  // the resolution of T
  if (farewell_.state_ms && !newer(t_ms, *farewell_.state_ms)) return false;
  const BoardClock::Instant shown = board_.clock().at(t_ms);
  if (!shown.error) return true;
  return *shown.error < fast ? shown.at + tick + *shown.error >= farewell_.at
                             : shown.at - *shown.error > farewell_.at;
}

void CommandsUnderWay::on_identity(const Identity& identity, Time now) {
  for (Pending& pending : pending_.under_way()) {
    if (identity.has_asked && identity.asked != pending.pnum) continue;
    BoardWiring wiring;
    const bool answered =
        pending.kind == CommandKind::identify ||
        (pending.kind == CommandKind::ask_wiring && read_board_wiring(identity.wiring, wiring));
    if (pending.is_out() && answered) {
      finish(pending, Outcome::confirmed, Refusal::none, now);
    }
  }
}

void CommandsUnderWay::on_refusal(const Nack& nack, bool proof, bool others, Time now) {
  for (Pending& pending : pending_.under_way()) {
    if (!pending.is_out() || pending.pnum != nack.pnum) continue;
    if (pending.kind == CommandKind::leave) {  // executed, or no session with this host
      const bool left = nack.code == Refusal::duplicate;
      if (!left && others) continue;  // a duplicate may be executed: a heartbeat shows that
      finish(pending, left ? Outcome::confirmed : Outcome::refused, nack.code, now);
      continue;
    }
    if (nack.code == Refusal::duplicate) {
      pending.stage = Stage::executed;
      on_state(now);
      continue;
    }
    if (!proof) continue;
    if (nack.at <= pending.group.size()) pending.failed = nack.at;
    finish(pending, Outcome::refused, nack.code, now);
  }
}

bool CommandsUnderWay::is_cable_only(std::uint32_t pnum) {
  for (const Pending& pending : pending_.under_way()) {
    if (pending.is_out() && pending.pnum == pnum) return pending.cable_only;
  }
  return false;
}

}  // namespace r4
