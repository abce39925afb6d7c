// SPDX-License-Identifier: GPL-3.0-or-later
#include "session.hpp"

#include <algorithm>
#include <bit>
#include <random>

#include "../../protocol/messages/command_field.hpp"
#include "../../protocol/messages/state_fields.hpp"
#include "../commands/command_help.hpp"
#include "limits.hpp"
#include "r4link/error.hpp"

namespace r4 {

std::uint64_t Session::random_bits() {
  std::random_device random;
  return std::uint64_t{random()} << 32 | random();
}

namespace {

// To know the board's clock, questions are asked more often than the program wants them: at first, until
// the error is small, and later where it is not. The interval is no whole number of milliseconds: the board's
// clock counts those, and so shows where they begin.
constexpr Time soon_interval{102'300};
constexpr Time first_goal{500}, later_goal{1'000};
constexpr int first_questions = 100, questions_in_vain = 10;
// The longest wait when nothing is due: Time::max() overflows when it is converted to nanoseconds.
constexpr Time longest_wait = std::chrono::hours{1};

// Before anything is made of them: their times may be too long to be reckoned with.
SessionOptions checked(SessionOptions options) {
  require_valid(options);
  return options;
}

}  // namespace

Session::Session(SessionOptions options, BoardRole role, std::size_t paths,
                 std::function<std::uint64_t()> random)
    : options_(checked(std::move(options))),
      board_role_(role),
      random_(std::move(random)),
      link_(options_.timing, static_cast<std::uint32_t>(random_())),
      key_(options_.key, options_.clock_start),
      selection_(options_.fields),
      question_(options_.identify_interval),
      paths_(paths, options_.timing, link_),
      pending_(max_pending, max_stops) {
  link_.hold(watches());
  begin_session();
  if (!options_.fields.empty()) {
    const std::string fields = options_.fields;
    if (FieldSet set; parse_fields(fields, set) != Refusal::none) {
      throw Error(bad_command("F:" + fields, Refusal::unknown));
    }
    require_valid(with_needed_fields(Command::fields(fields)));
  }
}

void Session::begin_session() {
  while (link_.wants_session()) link_.begin_session(random_());
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

void Session::poll(Time now) {
  link_.poll(to_ms(now));
  if (link_.long_silent(to_ms(now))) forget_board(now);
  notice_restart(now);
  ask_paths(now);
  refresh_status(now);
  if (!leaving_ && paths_.begun()) watches() ? send_lease(now) : send_heartbeat(now);
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
}

// Each path has a lease of its own, with its own T to echo.
void Session::send_lease(Time now) {
  const bool others = options_.fields != "DEFAULT";
  const Text list = others ? Text(options_.fields.data(), options_.fields.size()) : Text();
  for (std::size_t i = 0; i < paths_.count(); ++i) {
    Lease& lease = paths_.leases()[i];
    if ((paths_.speaking() & path_bit(i)) == 0 || !lease.due(now)) continue;
    transmit_now(Command::watch(options_.watch_rate_hz, list), lease.echo(), Priority::lease, now,
                 path_bit(i));
    lease.sent(now);
  }
}

void Session::send_heartbeat(Time now) {
  if (!link_.heartbeat_due(to_ms(now))) return;
  link_.heartbeat_sent(to_ms(now));  // on_sent() tells if it could not be
  const PathSet over = transmit_now(Command::heartbeat(), link_.echo(), Priority::normal, now);
  heartbeat_ = {CommandKind::heartbeat, link_.last_pnum(), std::popcount(over), SendResult::down};
  if (over == 0) link_.heartbeat_not_sent(to_ms(now));
}

Time Session::next_poll(Time now) {
  Time next = repetition_.next();
  for (const Pending& pending : pending_.under_way()) {
    next = std::min(next, pending.deadline);
    if (pending.is_out()) next = std::min(next, pending.retry);
  }
  if (leaving_) return std::min(next, now + longest_wait);
  Time link = now + std::chrono::milliseconds{link_.due_in(to_ms(now))};
  // due_in() counts whole milliseconds; aim behind the edge, not before it.
  link = std::chrono::duration_cast<std::chrono::milliseconds>(link) + Time{0};
  if (link <= now) link = now + Time{1000};
  if (paths_.begun()) next = std::min(next, link);
  if (watches()) next = std::min(next, paths_.leases().next(paths_.speaking()));
  next = std::min(next, paths_.next(now));
  if (hears_board()) next = std::min(next, question_.next(question_interval()));
  if (role_.refused(now)) next = std::min(next, role_.refused_until());
  if (group_waits_) next = std::min(next, groups_.next());
  return std::min(next, now + longest_wait);
}

void Session::on_transport(std::size_t path, bool up, Time now, bool can_ask) {
  paths_.on_transport(path, up, can_ask, now);
  transport_down_ = paths_.all_down();
  if (up || transport_down_) link_.on_transport(up);
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
  look_at_arming(now);
  const bool heard = is_heard(link_.state());
  LinkCauses causes = paths_.leases().causes(now);
  causes.set(LinkCause::transport_down, transport_down_);
  causes.set(heard ? LinkCause::other_board : LinkCause::two_boards, paths_.two_boards());
  causes.set(LinkCause::foreign_frames, trouble_ == TransportTrouble::foreign_frames);
  causes.set(LinkCause::late_frames, heard && trouble_ == TransportTrouble::late_frames);
  causes.set(LinkCause::busy, role_.refused(now));
  if (!watches()) {
    causes.set(LinkCause::watchdog, link_.watchdog_expired(to_ms(now)));
    causes.set(LinkCause::callback, link_.held());
    // The silence of a board that is lost says nothing of keys.
    const std::optional<LinkCause> key = key_.cause(now);
    if (key && link_.state() != HostLinkState::lost) causes.set(*key);
  }
  const LinkStatus fresh{
      .state = link_.state(),
      .reason = link_.reason(),
      .causes = causes,
      .in_control = in_control(now),
      .carrying = paths_.carrying(now),
      .chip = link_.reason() == SafeReason::fault ? state_.fault : ChipFault(),
  };
  if (fresh == status_) return;
  status_ = fresh;
  effects_.tell(LinkChanged{status_});
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
  report.packets = packets();
  // Not those of the numbers, which a transport that comes up begins anew.
  report.packets.restarts = link_.restarts();
  report.copies = packets().duplicate;
  report.received -= report.copies;
  if (state_.sampled_error != ReceivedState::unknown) {
    report.clock_drift_ppm = clock_.drift_ppm();
    report.clock_drift_error_ppm = clock_.drift_error_ppm();
  }
  return report;
}

}  // namespace r4
