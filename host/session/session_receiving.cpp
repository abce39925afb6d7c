// SPDX-License-Identifier: GPL-3.0-or-later
// What comes in, and what it proves.
#include "../../protocol/link/board_link.hpp"
#include "../../protocol/messages/state_fields.hpp"
#include "../commands/command_evidence.hpp"
#include "session.hpp"

namespace r4 {

void Session::receive(std::size_t path, std::string_view bytes, Time now) {
  Datagram datagram;
  const ReadResult result = read_datagram(bytes, datagram);
  if (!result) {
    ++collector_.counts.damaged;
    effects_.tell(BadDatagramCame{result, bytes});
    return;
  }
  const MessageKind kind = kind_of(datagram);
  const bool from_board = kind == MessageKind::board_heartbeat || kind == MessageKind::nack ||
                          kind == MessageKind::identity || kind == MessageKind::state;
  if (!from_board || !datagram.has_pnum() || !datagram.has_time()) return;
  ++collector_.counts.received;

  switch (kind) {
    case MessageKind::nack:
      on_nack_datagram(path, datagram, now);
      break;
    case MessageKind::identity:
      on_identity_datagram(path, datagram, now);
      break;
    case MessageKind::board_heartbeat:
      on_heartbeat_datagram(path, datagram, now);
      break;
    default:
      on_state_datagram(path, datagram, now);
      break;
  }
  refresh_status(now);
}

void Session::on_heartbeat_datagram(std::size_t path, const Datagram& datagram, Time now) {
  const bool connecting = is_connecting_heartbeat(datagram);
  const SafeReport report = heartbeat_report(datagram);
  const auto t_ms = static_cast<std::uint32_t>(datagram.time_ms());
  // On a bus a watcher hears this, too, although it is meant for hosts. The states report it to watchers.
  const bool passed_over = connecting && watches() && paths_.leases().streaming(now);
  bool taken = false;
  if (connecting) {
    taken = !passed_over && paths_.admit_connecting(path, now);
  } else {
    const Paths::Admission admission = paths_.admit(path, datagram.pnum(), t_ms, now);
    if (admission == Paths::Admission::restarted) on_restarted(now);
    taken = admission != Paths::Admission::no && paths_.news().take_heartbeat(path, t_ms);
  }
  if (!taken) {
    if (paths_.is_known(path)) confirm_stop(report, now);  // the stop's number proves it
    return;
  }
  const bool current = connecting || paths_.is_newest(t_ms, now);
  if (connecting) {
    link_.on_booting(report.reason, to_ms(now));
  } else {
    link_.on_heartbeat(t_ms);
    current ? link_.on_reason(report.reason, to_ms(now)) : link_.on_heard(to_ms(now));
  }
  notice_restart(now);
  if (current) {
    if (!connecting) clock_.heard(t_ms, now);
    state_.safe = report.reason;
    if (report.reason == SafeReason::none) state_.fault = ChipFault();
    key_.on_heartbeat(datagram);
    key_.on_board_time(t_ms, now);
    if (key_.asked_for()) selection_.on_answer();
    key_.on_reason(connecting ? SafeReason::link : report.reason, now);
  }
  effects_.tell(HeartbeatCame{datagram});
  if (!current) return;
  refresh_status(now);
  confirm_stop(report, now);
  confirm_leave(report, connecting ? 0 : t_ms, now);
  on_causes(report.cause, now);
}

void Session::on_state_datagram(std::size_t path, const Datagram& datagram, Time now) {
  const auto t_ms = static_cast<std::uint32_t>(datagram.time_ms());
  const Paths::Admission admission = paths_.admit(path, datagram.pnum(), t_ms, now);
  if (admission == Paths::Admission::no) return;
  if (admission == Paths::Admission::restarted) on_restarted(now);
  link_.on_heard(to_ms(now));
  paths_.leases()[path].on_state(now);
  if (!paths_.news().is_newest_state(path, t_ms)) return;
  ReceivedState fresh = state_;
  if (!read_state(datagram, fresh)) {
    ++collector_.counts.damaged;
    ReadResult result;
    result.error = ReadError::syntax;
    effects_.tell(BadDatagramCame{result, {datagram.bytes().data(), datagram.bytes().size()}});
    return;
  }
  if (!paths_.news().take_state(path, t_ms, fresh.present)) return;
  const SafeReason reason = fresh.present.has(StateField::safe) ? fresh.safe : SafeReason::none;
  // Heartbeats overtake states in a queue. An overtaken state is still the newest state.
  const bool current = paths_.is_newest(t_ms, now);
  collector_.on_state(fresh.t_ms, now);
  if (current) {
    link_.on_reason(reason, to_ms(now));
    key_.on_board_time(fresh.t_ms, now);
    key_.on_host_seen(now);
  }
  state_ = fresh;
  clock_.heard(state_.t_ms, now);
  const BoardClock::Instant sampled = clock_.at(state_.t_ms);
  state_.sampled = ReceivedState::Clock::time_point(sampled.at);
  state_.sampled_error = sampled.error ? *sampled.error : ReceivedState::unknown;
  state_.received = ReceivedState::Clock::time_point(now);
  state_.safe = reason;
  // It is in every state while there is one.
  if (!state_.present.has(StateField::fault)) state_.fault = ChipFault();
  refresh_status(now);
  confirm_from_state(now);
  look_at_supply();
  select_fields(now);
  effects_.tell(StateCame{datagram});
}

void Session::on_nack_datagram(std::size_t path, const Datagram& datagram, Time now) {
  Nack nack;
  if (!read_nack(datagram, nack)) return;
  const auto t_ms = static_cast<std::uint32_t>(datagram.time_ms());
  if (!paths_.admit_answer(path, datagram.pnum(), t_ms, nack.has_session, now)) return;
  if (nack.sid != session_id() || !link_.is_taken(nack.pnum)) {
    // Answers to other hosts are heard on a CAN bus, on a shared transport and in a recording.
    if (watches() && nack.has_session) link_.on_heard(to_ms(now));
    return;
  }
  link_.on_heard(to_ms(now));
  if (watches()) return on_lease_refused(path, nack, datagram, now);
  selection_.on_answer();
  if (nack.code == Refusal::busy) {
    paths_.on_busy(path, t_ms, now);
    if (paths_.all_busy(now)) role_.on_busy_until(paths_.all_busy_until(now));
    key_.on_host_seen(now);
  }
  const bool not_taken = nack.code == Refusal::auth && !is_cable_only(nack.pnum);
  if (not_taken) key_.on_refusal(now);
  // AUTH refuses one copy. A repetition, or the copy on another path, may have been executed.
  const bool other_copy =
      nack.code == Refusal::auth && ((not_taken && key_.has_key()) || others_speak(path));
  const bool proof = !other_copy && is_proof(nack);
  if (!paths_.news().is_copy(nack)) effects_.tell(CommandRefused{nack, datagram});
  for (Pending& pending : pending_.under_way()) {
    if (!pending.is_out() || pending.pnum != nack.pnum) continue;
    if (pending.kind == CommandKind::leave) {  // it was executed, or we have no session to leave
      const bool left = nack.code == Refusal::duplicate;
      if (!left && others_speak(path)) continue;  // of one copy: the board's heartbeats tell
      finish(pending, left ? Outcome::confirmed : Outcome::refused, nack.code, now);
      continue;
    }
    if (nack.code == Refusal::duplicate) {
      pending.stage = Stage::executed;
      confirm_from_state(now);
      continue;
    }
    if (!proof) continue;
    if (nack.at <= pending.group.size()) pending.failed = nack.at;
    finish(pending, Outcome::refused, nack.code, now);
  }
  if (proof) on_post_refused(nack);
}

// Of all that a session sends which only watches, the board refuses leases alone. What those codes say the
// link tells.
void Session::on_lease_refused(std::size_t path, const Nack& nack, const Datagram& datagram,
                               Time now) {
  paths_.leases()[path].on_refusal(nack, now);
  const bool told =
      nack.code == Refusal::stale || nack.code == Refusal::busy || nack.code == Refusal::unknown;
  if (!told) effects_.tell(CommandRefused{nack, datagram});
}

// Does the refusal prove that the command was not executed? Only while the board remembers what it
// executed: in the session in which the command was sent, and not after too many numbers. Without
// proof the deadline ends it, as unknown.
bool Session::is_proof(const Nack& nack) const {
  // By how many numbers ago each was taken, since a session may be older than half of all numbers.
  const std::uint32_t since_command = link_.last_pnum() - nack.pnum;
  const std::uint32_t since_session = link_.last_pnum() - nack.session;
  return nack.has_session && link_.is_taken(nack.session) && since_session > since_command &&
         since_command < BoardLink::memory;
}

void Session::on_identity_datagram(std::size_t path, const Datagram& datagram, Time now) {
  Identity identity;
  if (!read_identity(datagram, identity)) return;
  if (!watches() && identity.sid != session_id()) return;  // an answer to another host
  const auto t_ms = static_cast<std::uint32_t>(datagram.time_ms());
  const Paths::Admission admission = paths_.admit_identity(path, identity, t_ms, now);
  if (admission == Paths::Admission::no) return;
  if (admission == Paths::Admission::restarted) on_restarted(now);
  paths_.admit_answer(path, datagram.pnum(), t_ms, counts(identity), now);
  if (counts(identity)) link_.on_heard(to_ms(now));
  selection_.on_answer();
  knows_leave_ = has_capability(identity.capabilities, leave_capability);
  groups_.on_identity(identity.capabilities);
  if (const auto asked = question_.answered(identity)) {
    collector_.on_round_trip(now - *asked);
    clock_.heard(t_ms, now);
    if (identity.has_asked) clock_.answered(t_ms, *asked);
  }
  effects_.tell(BoardIdentified{identity});
  for (Pending& pending : pending_.under_way()) {
    // A second answer to an earlier question is none to this one.
    if (identity.has_asked && identity.asked != pending.pnum) continue;
    if (pending.is_out() && pending.kind == CommandKind::identify) {
      finish(pending, Outcome::confirmed, Refusal::none, now);
    }
  }
}

// Is that one of our settings that the board takes over a cable only?
bool Session::is_cable_only(std::uint32_t pnum) {
  for (const Pending& pending : pending_.under_way()) {
    if (pending.is_out() && pending.pnum == pnum) return pending.cable_only;
  }
  return false;
}

// True if its number is one of those that the states have. Answers to hosts without control are numbered apart.
bool Session::counts(const Identity& identity) const {
  const bool to_watcher = watches() && identity.sid == no_session;
  return to_watcher || !(identity.has_busy && identity.busy);
}

// A path has proved a restart of the board.
void Session::on_restarted(Time now) {
  link_.on_restart();
  link_.on_heard(to_ms(now));
  notice_restart(now);
}

// A board that begins again knows nothing of what it had before. True if it has just been found to.
bool Session::notice_restart(Time now) {
  if (restarts_ == link_.restarts()) return false;
  restarts_ = link_.restarts();
  knows_leave_.reset();
  state_ = ReceivedState();
  clock_.restart();
  questions_of_clock_ = 0;
  groups_.on_restart();
  arming_.disarm(DisarmCause::restart);
  if (link_.wants_session()) {
    begin_session();
    give_up_commands(now);
  }
  tell_arming();  // what somebody asks for when he hears of it is wanted
  effects_.tell(BoardRestarted{});
  return true;
}

// A board whose timeout was raised may be driving still: the session that it has ends at once.
void Session::on_sleep(Time now) {
  if (may_say_farewell()) {
    transmit_now(Command::leave(), link_.echo(), Priority::normal, now);
  }
  repetition_.cancel();
  arming_.on_sleep();
  forget_board(now);
  notice_restart(now);
  refresh_status(now);
}

// The board's T cannot be compared with what was heard before.
void Session::forget_board(Time now) {
  link_.begin_anew();
  paths_.on_sleep(now);
}

// A state shows that the board has executed a command of ours in the session that it has.
void Session::note_own_command(Time now) {
  paths_.on_own_state(state_.t_ms, now);
  role_.on_own_command(!paths_.all_busy(now), now);
}

// Our clock may have stood still, and their deadlines with it: nobody wants now what was asked for then.
void Session::give_up_commands(Time now) {
  end_arming(Outcome::cancelled, Refusal::none, now);
  for (Pending& pending : pending_.under_way()) {
    if (pending.kind == CommandKind::stop || pending.kind == CommandKind::identify) continue;
    finish(pending, Outcome::cancelled, Refusal::none, now);
  }
}

// --- what the board's state proves

void Session::confirm_from_state(Time now) {
  const bool has_cmd = state_.present.has(StateField::cmd);
  if (has_cmd) {
    selection_.on_cmd(now);
    if (link_up() && link_.is_taken(state_.last_command)) note_own_command(now);
  }
  for (Pending& pending : pending_.under_way()) {
    if (!pending.is_out() || pending.kind == CommandKind::stop ||
        pending.kind == CommandKind::identify || pending.kind == CommandKind::leave) {
      continue;
    }
    if (has_cmd) {
      const bool exact = state_.last_command == pending.pnum;
      const bool past = newer(state_.last_command, pending.pnum);
      if (exact || (past && pending.stage == Stage::executed)) {
        finish(pending, Outcome::confirmed, Refusal::none, now);
      } else if (past && pending.stage == Stage::sent) {
        pending.stage = Stage::overtaken;
        pending.retry = now;  // ask at once what became of it
      }
    } else if (!selection_.answers() && selection_.stage() != FieldSelection::Stage::asking &&
               state_shows(state_, pending.command)) {
      finish(pending, Outcome::confirmed, Refusal::none, now);
    }
  }
}

// The board names the stop that it has obeyed.
void Session::confirm_stop(const SafeReport& report, Time now) {
  if (report.reason != SafeReason::stop || !report.has_stop) return;
  for (Pending& pending : pending_.under_way()) {
    if (!pending.is_out() || pending.kind != CommandKind::stop) continue;
    if (report.stop != pending.pnum) continue;
    repetition_.begin({pending.bytes.data(), pending.size}, pending.retry,
                      now + options_.stop_linger);
    finish(pending, Outcome::confirmed, Refusal::none, now);
  }
}

// A board whose host has left is safe for that reason, unless there is a graver one, or its heartbeat may be of before
// the farewell: then its answer to a repetition tells. `t_ms`: its T, 0 of a board that is booting.
void Session::confirm_leave(const SafeReport& report, std::uint32_t t_ms, Time now) {
  if (report.reason != SafeReason::link || (t_ms != 0 && !is_behind_leave(t_ms))) return;
  for (Pending& pending : pending_.under_way()) {
    if (pending.kind == CommandKind::leave) finish(pending, Outcome::confirmed, Refusal::none, now);
  }
}

// Was a heartbeat with that T sent behind the farewell? It may be of the same millisecond as a state
// that told otherwise. Where the clocks tell little, for the network is slow, only what they tell for certain counts.
bool Session::is_behind_leave(std::uint32_t t_ms) const {
  constexpr Time fast{5000};
  constexpr Time tick{1000};  // so long a T is shown
  if (left_ms_ && !newer(t_ms, *left_ms_)) return false;
  const BoardClock::Instant shown = clock_.at(t_ms);
  if (!shown.error) return true;
  return *shown.error < fast ? shown.at + tick + *shown.error >= left_at_
                             : shown.at - *shown.error > left_at_;
}

// The number of the newest cause that only E:CLEAR ends. A newer one than that which an E:CLEAR or an
// arm() was to clear has come after it was asked for, so that it is given up.
void Session::on_causes(std::int32_t newest, Time now) {
  cause_ = newest;
  for (Pending& pending : pending_.under_way()) {
    const bool arms = pending.role == Pending::Role::arm;
    if ((pending.kind != CommandKind::clear && !arms) || !name_cause(pending)) continue;
    if (newest == 0 || newest == pending.cause) continue;
    if (arms) {
      end_arming(Outcome::not_armed, Refusal::none, now);
    } else {
      finish(pending, Outcome::cancelled, Refusal::none, now);
    }
  }
}

}  // namespace r4
