// SPDX-License-Identifier: GPL-3.0-or-later
#include "session.hpp"

#include <algorithm>
#include <random>

#include "../../protocol/link/board_link.hpp"
#include "../../protocol/messages/command_field.hpp"
#include "../../protocol/messages/state_fields.hpp"
#include "../../transports/framing/can/can_ids.hpp"
#include "../commands/command_evidence.hpp"
#include "../commands/command_help.hpp"
#include "limits.hpp"
#include "r4link/error.hpp"

namespace r4 {

std::uint32_t Session::random_first_pnum() {
  std::random_device random;
  return echo_host_first_pnum + (random() & 0x3fffffffU);
}

namespace {

// To know the board's clock, questions are asked more often than the program wants them: at first, until
// the error is small, and later where it is not. The interval is no whole number of milliseconds: the board's
// clock counts those, and so shows where they begin.
constexpr Time soon_interval{102'300};
constexpr Time first_goal{500}, later_goal{1'000};
constexpr int first_questions = 100, questions_in_vain = 10;

// Before anything is made of them: their times may be too long to be reckoned with.
SessionOptions checked(SessionOptions options) {
  require_valid(options);
  return options;
}

}  // namespace

Session::Session(Handler& handler, SessionOptions options, std::uint32_t first_pnum, BoardRole role)
    : handler_(handler),
      options_(checked(std::move(options))),
      board_role_(role),
      first_pnum_(first_pnum),
      link_(options_.timing, first_pnum),
      key_(options_.key, options_.clock_start),
      selection_(options_.fields),
      question_(options_.identify_interval),
      pending_(max_pending, max_stops) {
  link_.hold(watches());
  if (!options_.fields.empty()) {
    const std::string fields = options_.fields;
    if (FieldSet set; parse_fields(fields, set) != Refusal::none) {
      throw Error(bad_command("F:" + fields, Refusal::unknown));
    }
    require_valid(with_needed_fields(Command::fields(fields)));
  }
}

// --- what comes in

void Session::receive(std::string_view bytes, Time now) {
  Datagram datagram;
  const ReadResult result = read_datagram(bytes, datagram);
  if (!result) {
    ++collector_.counts.damaged;
    handler_.on_bad_datagram(result, bytes);
    return;
  }
  const MessageKind kind = kind_of(datagram);
  const bool from_board = kind == MessageKind::board_heartbeat || kind == MessageKind::nack ||
                          kind == MessageKind::identity || kind == MessageKind::state;
  if (!from_board || !datagram.has_pnum() || !datagram.has_time()) return;
  ++collector_.counts.received;

  switch (kind) {
    case MessageKind::nack:
      on_nack_datagram(datagram, now);
      break;
    case MessageKind::identity:
      on_identity_datagram(datagram, now);
      break;
    case MessageKind::board_heartbeat:
      on_heartbeat_datagram(datagram, now);
      break;
    default:
      on_state_datagram(datagram, now);
      break;
  }
  refresh_status(now);
}

void Session::on_heartbeat_datagram(const Datagram& datagram, Time now) {
  const bool connecting = is_connecting_heartbeat(datagram);
  // Said to hosts, on a wire that others listen to; who watches is told by the states that there is none.
  const SafeReport report = heartbeat_report(datagram);
  if (connecting && watches() && lease_.streaming(now)) return confirm_stop(report, now);
  const auto t_ms = static_cast<std::uint32_t>(datagram.time_ms());
  const bool current = is_current(
      link_.on_datagram(datagram.pnum(), connecting ? 0 : t_ms, true, report.reason, to_ms(now)));
  notice_restart();
  if (current) {
    if (!connecting) clock_.heard(t_ms, now);
    state_.safe = report.reason;
    if (report.reason == SafeReason::none) state_.fault = ChipFault();
    key_.on_heartbeat(datagram);
    key_.on_board_time(t_ms, now);
    if (key_.asked_for()) selection_.on_answer();
    key_.on_reason(connecting ? SafeReason::link : report.reason, now);
  }
  handler_.on_board_heartbeat(datagram);
  if (!current) return;
  refresh_status(now);
  confirm_stop(report, now);
  confirm_leave(report, now);
  on_causes(report.cause, now);
}

void Session::on_state_datagram(const Datagram& datagram, Time now) {
  ReceivedState fresh = state_;
  if (!read_state(datagram, fresh)) {
    ++collector_.counts.damaged;
    ReadResult result;
    result.error = ReadError::syntax;
    handler_.on_bad_datagram(result,
                             std::string_view(datagram.bytes().data(), datagram.bytes().size()));
    return;
  }
  const SafeReason reason = fresh.present.has(StateField::safe) ? fresh.safe : SafeReason::none;
  const Arrival arrival = link_.on_datagram(fresh.pnum, fresh.t_ms, false, reason, to_ms(now));
  if (notice_restart()) {  // nothing of the boot before
    fresh = state_;
    read_state(datagram, fresh);
  }
  // An older state must not replace a newer one. A late one that only a heartbeat or an answer has
  // overtaken, in a queue where those go first, is still the newest state.
  const bool newest_state = arrival == Arrival::late && newer(fresh.pnum, state_.pnum);
  if (!is_current(arrival) && !newest_state) return;
  lease_.on_state(now);
  collector_.on_state(fresh.t_ms, now);
  if (!newest_state) {
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
  handler_.on_state(state_, datagram);
}

void Session::on_nack_datagram(const Datagram& datagram, Time now) {
  Nack nack;
  if (!read_nack(datagram, nack)) return;
  if (!is_ours(nack.pnum)) {
    // On a CAN bus, on a wire that is shared and in a recording the answers to other hosts are heard, too. One to
    // the host in control has a number among those of the states; one to who has no lease yet has not.
    if (watches() && nack.has_session) on_answer(datagram, now);
    return;
  }
  if (watches()) return on_lease_refused(nack, datagram, now);
  selection_.on_answer();
  if (nack.code == Refusal::busy) {
    role_.on_busy(now);
    key_.on_host_seen(now);
  }
  on_answer(datagram, now);
  const bool not_taken = nack.code == Refusal::auth && !is_cable_only(nack.pnum);
  if (not_taken) key_.on_refusal(now);
  const bool other_copy = not_taken && key_.has_key();  // may have been executed
  const bool proof = !other_copy && is_proof(nack);
  handler_.on_nack(nack, datagram);
  for (Pending& pending : pending_.under_way()) {
    if (!pending.is_out() || pending.pnum != nack.pnum) continue;
    if (pending.kind == CommandKind::leave) {  // it was executed, or we have no session to leave
      const bool left = nack.code == Refusal::duplicate;
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
void Session::on_lease_refused(const Nack& nack, const Datagram& datagram, Time now) {
  on_answer(datagram, now);
  lease_.on_refusal(nack, now);
  const bool told =
      nack.code == Refusal::stale || nack.code == Refusal::busy || nack.code == Refusal::unknown;
  if (!told) handler_.on_nack(nack, datagram);
}

// Does the refusal prove that the command was not executed? Only while the board remembers what it
// executed: in the session in which the command was sent, and not after too many numbers. Without
// proof the deadline ends it, as unknown.
bool Session::is_proof(const Nack& nack) const {
  return nack.has_session && is_ours(nack.session) && newer(nack.pnum, nack.session) &&
         link_.last_pnum() - nack.pnum < BoardLink::memory;
}

void Session::on_identity_datagram(const Datagram& datagram, Time now) {
  Identity identity;
  if (!read_identity(datagram, identity)) return;
  selection_.on_answer();
  on_answer(datagram, now);
  knows_leave_ = has_capability(identity.capabilities, leave_capability);
  groups_.on_identity(identity.capabilities);
  if (const auto asked = question_.answered(identity)) {
    collector_.on_round_trip(now - *asked);
    const auto t_ms = static_cast<std::uint32_t>(datagram.time_ms());
    clock_.heard(t_ms, now);
    if (identity.has_asked) clock_.answered(t_ms, *asked);
  }
  handler_.on_identity(identity);
  for (Pending& pending : pending_.under_way()) {
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

// Have we sent a datagram with that number?
bool Session::is_ours(std::uint32_t pnum) const {
  return pnum - first_pnum_ <= link_.last_pnum() - first_pnum_;
}

// An answer counts in the board's packet numbers, but not in those that a host without control
// sees.
void Session::on_answer(const Datagram& datagram, Time now) {
  if (role_.refused(now)) return;
  link_.on_answer(datagram.pnum(), static_cast<std::uint32_t>(datagram.time_ms()), to_ms(now));
  notice_restart();
}

// A board that begins again knows nothing of what it had before. True if it has just been found to.
bool Session::notice_restart() {
  if (restarts_ == link_.restarts()) return false;
  restarts_ = link_.restarts();
  knows_leave_ = false;
  state_ = ReceivedState();
  clock_.restart();
  questions_of_clock_ = 0;
  groups_.on_restart();
  disarm(DisarmCause::restart);
  handler_.on_restart();
  return true;
}

// --- what the board's state proves

void Session::confirm_from_state(Time now) {
  const bool has_cmd = state_.present.has(StateField::cmd);
  if (has_cmd) {
    selection_.on_cmd(now);
    if (link_up() && is_ours(state_.last_command)) role_.on_own_command(now);
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

// The board names the stop that it has obeyed. On a CAN bus it was told the end of the number only.
void Session::confirm_stop(const SafeReport& report, Time now) {
  if (report.reason != SafeReason::stop || !report.has_stop) return;
  for (Pending& pending : pending_.under_way()) {
    if (!pending.is_out() || pending.kind != CommandKind::stop) continue;
    if (report.stop != pending.pnum && report.stop != short_stop_number(pending.pnum)) continue;
    repetition_.begin({pending.bytes.data(), pending.size}, pending.retry,
                      now + options_.stop_linger);
    finish(pending, Outcome::confirmed, Refusal::none, now);
  }
}

// A board whose host has left is safe for that reason, unless there is a graver one: then its answer to
// a repetition tells.
void Session::confirm_leave(const SafeReport& report, Time now) {
  if (report.reason != SafeReason::link) return;
  for (Pending& pending : pending_.under_way()) {
    if (pending.kind == CommandKind::leave) finish(pending, Outcome::confirmed, Refusal::none, now);
  }
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

// Sees to it that the state has the fields we need, whoever chose others, and that we are in
// control.
void Session::select_fields(Time now) {
  if (leaving_ || watches()) return;
  if (!selection_.ask(role_.controlling(), link_up() && !role_.refused(now), now)) return;
  transmit_now(Command::fields(selection_.fields()), to_ms(now), Priority::normal, now);
}

// A command that chooses fields, with those that we need; the choice is remembered.
Command Session::with_needed_fields(const Command& command) {
  if (command.kind != CommandKind::fields || selection_.fields().empty()) return command;
  FieldSet set;
  parse_fields(command.text, set);
  std::string fields(command.text.data(), command.text.size());
  if (!set.has(StateField::safe)) fields += ",SAFE";
  if (!set.has(StateField::cmd)) fields += ",CMD";
  if (!set.has(StateField::relays) && options_.arming == Arming::required) fields += ",RELAYS";
  if (fields != selection_.fields()) selection_.choose(std::move(fields));
  return Command::fields(selection_.fields());
}

// --- time

Time Session::poll(Time now) {
  link_.poll(to_ms(now));
  refresh_status(now);
  if (!leaving_) watches() ? send_lease(now) : send_heartbeat(now);
  for (Pending& pending : pending_.under_way()) {
    if (now >= pending.deadline) {
      finish(pending, Outcome::timed_out, Refusal::none, now);
    }
  }
  if (!role_.controlling()) select_fields(now);  // the first thing when the link comes up
  send_queued(now);
  advance_arming(now);
  refuse_held_back(now);
  send_queued(now);  // what has waited for arm()
  retry_due(now);
  repeat_stop(now);
  if (!leaving_ && hears_board() && question_.due(question_interval(), now)) {
    transmit_now(Command::identify(), to_ms(now), Priority::normal, now);
    question_.ask(link_.last_pnum(), now);
    ++questions_of_clock_;
  }
  return next_poll(now);
}

void Session::send_lease(Time now) {
  if (!lease_.due(now)) return;
  const bool others = options_.fields != "DEFAULT";
  const Text list = others ? Text(options_.fields.data(), options_.fields.size()) : Text();
  transmit_now(Command::watch(options_.watch_rate_hz, list), lease_.echo(), Priority::normal, now);
  lease_.sent(now);
}

void Session::send_heartbeat(Time now) {
  if (!link_.heartbeat_due(to_ms(now))) return;
  if (transmit_now(Command::heartbeat(), link_.echo(), Priority::normal, now) == SendResult::sent) {
    ++collector_.counts.heartbeats;
    key_.on_heartbeat_sent();
    link_.heartbeat_sent(to_ms(now));
  } else {
    link_.heartbeat_not_sent(to_ms(now));
  }
}

Time Session::next_poll(Time now) {
  Time next = repetition_.next();
  for (const Pending& pending : pending_.under_way()) {
    next = std::min(next, pending.deadline);
    if (pending.is_out()) next = std::min(next, pending.retry);
  }
  if (leaving_) return next;
  Time link = now + std::chrono::milliseconds{link_.due_in(to_ms(now))};
  // due_in() counts whole milliseconds; aim behind the edge, not before it.
  link = std::chrono::duration_cast<std::chrono::milliseconds>(link) + Time{0};
  if (link <= now) link = now + Time{1000};
  next = std::min(next, link);
  if (watches()) next = std::min(next, lease_.next());
  if (hears_board()) next = std::min(next, question_.next(question_interval()));
  if (role_.refused(now)) next = std::min(next, role_.refused_until());
  if (group_waits_) next = std::min(next, groups_.next());
  return next;
}

void Session::on_transport(bool up, Time now) {
  transport_down_ = !up;
  link_.on_transport(up);
  if (up && watches()) {
    // A program that shares a wire hears the board from elsewhere, in other numbers; and who held the wire
    // may have ended the lease, if that one controlled the board.
    link_.forget_numbers();
    lease_.renew(now);
  }
  refresh_status(now);
}

bool Session::link_up() const {
  if (!link_.echoed() || key_.refuses_board()) return false;
  switch (link_.state()) {
    case HostLinkState::active:
      return true;
    case HostLinkState::safe:
      return link_.reason() != SafeReason::link;
    case HostLinkState::connecting:
    case HostLinkState::lost:
      return false;
  }
  return false;
}

// Is the board there, whatever it thinks of us?
bool Session::hears_board() const {
  if (!watches()) return link_up();
  return is_heard(link_.state());
}

Time Session::question_interval() const {
  const bool first = questions_of_clock_ < first_questions;
  const bool known = state_.sampled_error != ReceivedState::unknown;
  const Time enough = first ? first_goal : later_goal;
  const bool soon = known ? state_.sampled_error > enough : questions_of_clock_ < questions_in_vain;
  return soon ? soon_interval : Time{options_.identify_interval};
}

// Commands wait for proof of control: the session's own F, executed. So none is ever sent into a
// session that the board has not accepted, where a refusal would say nothing.
bool Session::in_control(Time now) const {
  const FieldSelection::Stage stage = selection_.stage();
  const bool no_proof_to_come =
      stage == FieldSelection::Stage::left || stage == FieldSelection::Stage::unheard;
  return !leaving_ && link_up() && !role_.refused(now) &&
         (role_.controlling() || no_proof_to_come) && !link_.gated(to_ms(now));
}

void Session::refresh_status(Time now) {
  role_.on_link(link_up(), now);
  look_at_arming();
  const LinkStatus fresh{
      .state = link_.state(),
      .reason = link_.reason(),
      .busy = role_.refused(now),
      .gate = watches()                            ? Gate::open
              : link_.watchdog_expired(to_ms(now)) ? Gate::watchdog
              : link_.gated(to_ms(now))            ? Gate::callback
                                                   : Gate::open,
      .key = watches() ? KeyTrouble::none : key_.trouble(now),
      .lease = lease_.trouble(now),
      .in_control = in_control(now),
      .transport_down = transport_down_,
      .chip = link_.reason() == SafeReason::fault ? state_.fault : ChipFault(),
  };
  if (fresh == status_) return;
  status_ = fresh;
  handler_.on_link(status_);
}

void Session::watchdog(std::chrono::milliseconds period, Time now) {
  link_.watchdog(static_cast<std::uint32_t>(period.count()), to_ms(now));
  refresh_status(now);
}

void Session::hold(bool held, Time now) {
  if (watches()) return;
  link_.hold(held);
  refresh_status(now);
}

void Session::feed(Time now) {
  link_.feed(to_ms(now));
  refresh_status(now);
}

Statistics Session::statistics(Time now) const {
  Statistics report = collector_.report(now);
  report.packets = link_.counters();
  if (state_.sampled_error != ReceivedState::unknown) {
    report.clock_drift_ppm = clock_.drift_ppm();
    report.clock_drift_error_ppm = clock_.drift_error_ppm();
  }
  return report;
}

}  // namespace r4
