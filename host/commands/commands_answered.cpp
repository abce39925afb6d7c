// SPDX-License-Identifier: GPL-3.0-or-later
// What the board's datagrams prove of the commands under way.
#include "command_evidence.hpp"
#include "commands_under_way.hpp"

namespace r4 {

void CommandsUnderWay::on_state(Time now) {
  const ReceivedState& state = board_.state();
  const FieldSelection& fields = keeper_.fields();
  for (Pending& pending : pending_.under_way()) {
    if (!pending.is_out() || pending.kind == CommandKind::stop ||
        pending.kind == CommandKind::identify || pending.kind == CommandKind::leave) {
      continue;
    }
    if (board_.confirms()) {
      const bool exact = state.last_command == pending.pnum;
      const bool past = newer(state.last_command, pending.pnum);
      if (exact || (past && pending.stage == Stage::executed)) {
        finish(pending, Outcome::confirmed, Refusal::none, now);
      } else if (past && pending.stage == Stage::sent) {
        pending.stage = Stage::overtaken;
        pending.retry = now;  // ask at once what became of it
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
    if (!pending.is_out() || pending.kind != CommandKind::stop) continue;
    if (report.stop != pending.pnum) continue;
    repetition_.begin({pending.bytes.data(), pending.size}, pending.retry,
                      now + options_.stop_linger);
    finish(pending, Outcome::confirmed, Refusal::none, now);
  }
}

// A board whose host has left is safe for the reason `link`, unless there is a graver one. A heartbeat
// from before the farewell proves nothing; then the answer to a repetition does.
void CommandsUnderWay::on_heartbeat(const SafeReport& report, std::optional<std::uint32_t> t_ms,
                                    Time now) {
  on_stop(report, now);
  cause_ = report.cause;
  const bool left = report.reason == SafeReason::link && (!t_ms || is_behind_farewell(*t_ms));
  for (Pending& pending : pending_.under_way()) {
    if (pending.kind == CommandKind::leave && left) {
      finish(pending, Outcome::confirmed, Refusal::none, now);
    }
    if (pending.kind != CommandKind::clear || !name_cause(pending)) continue;
    // A newer cause came after this E:CLEAR was asked for.
    if (cause_ != 0 && cause_ != pending.cause) {
      finish(pending, Outcome::cancelled, Refusal::none, now);
    }
  }
}

// True if a heartbeat with that T was sent after the farewell. It may be of the same millisecond as a
// state that told otherwise. On a slow network the clocks tell little, and only what is certain counts.
bool CommandsUnderWay::is_behind_farewell(std::uint32_t t_ms) const {
  constexpr Time fast{5000};
  constexpr Time tick{1000};  // for this long the board shows one T
  if (farewell_.state_ms && !newer(t_ms, *farewell_.state_ms)) return false;
  const BoardClock::Instant shown = board_.clock().at(t_ms);
  if (!shown.error) return true;
  return *shown.error < fast ? shown.at + tick + *shown.error >= farewell_.at
                             : shown.at - *shown.error > farewell_.at;
}

void CommandsUnderWay::on_identity(const Identity& identity, Time now) {
  for (Pending& pending : pending_.under_way()) {
    // A second answer to an earlier question does not answer this one.
    if (identity.has_asked && identity.asked != pending.pnum) continue;
    if (pending.is_out() && pending.kind == CommandKind::identify) {
      finish(pending, Outcome::confirmed, Refusal::none, now);
    }
  }
}

void CommandsUnderWay::on_refusal(const Nack& nack, bool proof, bool others, Time now) {
  for (Pending& pending : pending_.under_way()) {
    if (!pending.is_out() || pending.pnum != nack.pnum) continue;
    if (pending.kind == CommandKind::leave) {  // executed, or the board has no session to leave
      const bool left = nack.code == Refusal::duplicate;
      if (!left && others) continue;  // one copy was refused: the board's heartbeats tell
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
