// SPDX-License-Identifier: GPL-3.0-or-later
#include "link_keeper.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

namespace r4 {

LinkKeeper::LinkKeeper(const SessionOptions& options, HostLink& link, HostKey& key, Paths& paths,
                       Outbox& outbox, Statistics& counts)
    : options_(options),
      link_(link),
      key_(key),
      paths_(paths),
      outbox_(outbox),
      counts_(counts),
      fields_(options.fields) {
  hold(false);
}

void LinkKeeper::on_transport(std::size_t path, bool up, bool can_ask, Time now) {
  paths_.on_transport(path, up, can_ask, now);
  transport_down_ = paths_.all_down();
  if (up || transport_down_) link_.on_transport(up);
}

void LinkKeeper::on_sent(const Sending& sending, SendResult result, Time now) {
  const bool sent_before = heartbeat_.result() == SendResult::sent;
  if (heartbeat_.on_sent(sending, result)) {
    if (!sent_before && heartbeat_.result() == SendResult::sent) {
      ++counts_.heartbeats;
      key_.on_heartbeat_sent();
    }
    if (heartbeat_.failed()) link_.heartbeat_not_sent(to_ms(now));
  }
  if (sending.kind == CommandKind::identify) {
    paths_.asked(sending.path, sending.pnum, result == SendResult::sent, now);
  }
  if (result == SendResult::busy) on_busy(sending.path, {}, now);
}

void LinkKeeper::on_busy(std::size_t path, std::optional<std::uint32_t> t_ms, Time now) {
  paths_.on_busy(path, t_ms, now);
  if (const auto until = paths_.all_busy_until(now)) role_.on_busy_until(*until);
}

void LinkKeeper::on_own_command(std::uint32_t t_ms, Time now) {
  paths_.on_own_state(t_ms, now);
  role_.on_own_command(!paths_.all_busy_until(now), now);
}

void LinkKeeper::ask_paths(Time now) {
  if (const PathSet due = paths_.to_ask(now); due != 0) {
    outbox_.send(Command::identify(), {.paths = due, .unknown_too = true}, now);
  }
  if (paths_.poll(now)) link_.on_transport(true);  // sends the first heartbeat at once
}

void LinkKeeper::keep_alive(Time now) {
  if (leaving_ || !paths_.begun()) return;
  watches() ? send_lease(now) : send_heartbeat(now);
}

void LinkKeeper::send_lease(Time now) {
  const Text list = options_.fields != "DEFAULT" ? Text(options_.fields) : Text();
  for (std::size_t i = 0; i < paths_.count(); ++i) {
    Lease& lease = paths_.lease(i);
    if ((paths_.speaking() & path_bit(i)) == 0 || !lease.due(now)) continue;
    outbox_.send(Command::watch(options_.watch_rate_hz, list),
                 {.priority = Priority::lease, .paths = path_bit(i), .echo = lease.echo()}, now);
    lease.sent(now);
  }
}

void LinkKeeper::send_heartbeat(Time now) {
  if (!link_.heartbeat_due(to_ms(now))) return;
  link_.heartbeat_sent(to_ms(now));  // if no path sends it, on_sent() undoes this
  heartbeat_.begin(outbox_.send(Command::heartbeat(), {.echo = link_.echo()}, now));
  if (heartbeat_.failed()) link_.heartbeat_not_sent(to_ms(now));
}

void LinkKeeper::select_fields(Time now) {
  if (leaving_ || watches()) return;
  if (!fields_.ask(role_.controlling(), is_up() && !role_.refused(now), now)) return;
  outbox_.send(Command::fields(fields_.fields()), {}, now);
}

Time LinkKeeper::next(Time now) const {
  // due_in() counts whole milliseconds.
  Time link = now + std::chrono::milliseconds{link_.due_in(to_ms(now))};
  link = std::chrono::floor<std::chrono::milliseconds>(link);
  if (link <= now) link = now + Time{1000};
  Time next = paths_.begun() ? link : Time::max();
  if (watches()) next = std::min(next, paths_.next_lease());
  if (role_.refused(now)) next = std::min(next, role_.refused_until());
  return std::min(next, paths_.next(now));
}

// Ends the heartbeats: a heartbeat after the farewell would take control again.
void LinkKeeper::leave(Time now) {
  for (std::size_t i = 0; watches() && i < paths_.count(); ++i) {
    outbox_.send(Command::watch(0), {.paths = path_bit(i), .echo = paths_.lease(i).echo()}, now);
  }
  leaving_ = true;
}

void LinkKeeper::begin_anew() {
  role_ = HostRoleMachine();
  fields_.begin_anew();
  leaving_ = false;
  link_.leave_session();
  hold(held_);
}

void LinkKeeper::hold(bool held) {
  held_ = held;
  link_.hold(held_ || stopping_ || watches());
}

void LinkKeeper::hold_for_stop(bool stopping) {
  stopping_ = stopping;
  hold(held_);
}

bool LinkKeeper::is_up() const {
  const HostLinkState state = link_.state();
  return link_.echoed() && !key_.refuses_board() &&
         (state == HostLinkState::active ||
          (state == HostLinkState::safe && link_.reason() != SafeReason::link));
}

// Commands wait for proof of control: the board has executed this session's F. Before that, the
// board may not have accepted the session, and a refusal would prove nothing.
bool LinkKeeper::in_control(Time now) const {
  const FieldSelection::Stage stage = fields_.stage();
  const bool no_proof_to_come =
      stage == FieldSelection::Stage::left || stage == FieldSelection::Stage::unheard;
  return !leaving_ && is_up() && !role_.refused(now) && (role_.controlling() || no_proof_to_come) &&
         !link_.gated(to_ms(now));
}

LinkStatus LinkKeeper::status(ChipFault fault, Time now) const {
  const bool heard = is_heard(link_.state());
  LinkCauses causes = watches() ? paths_.lease_causes(now) : LinkCauses();
  causes.set(LinkCause::transport_down, transport_down_);
  causes.set(heard ? LinkCause::other_board : LinkCause::two_boards, paths_.two_boards());
  causes.set(LinkCause::foreign_frames, trouble_ == TransportTrouble::foreign_frames);
  causes.set(LinkCause::late_frames, heard && trouble_ == TransportTrouble::late_frames);
  causes.set(LinkCause::busy, role_.refused(now));
  if (!watches()) {
    causes.set(LinkCause::watchdog, link_.watchdog_expired(to_ms(now)));
    causes.set(LinkCause::callback, held_);
    // A lost board's silence does not indicate a wrong key.
    const std::optional<LinkCause> key = key_.cause(now);
    if (key && link_.state() != HostLinkState::lost) causes.set(*key);
  }
  return {
      .state = link_.state(),
      .reason = link_.reason(),
      .causes = causes,
      .in_control = in_control(now),
      .carrying = paths_.carrying(now),
      .chip = link_.reason() == SafeReason::fault ? fault : ChipFault(),
  };
}

Command LinkKeeper::with_needed_fields(const Command& command) {
  if (command.kind != CommandKind::fields || fields_.fields().empty()) return command;
  FieldSet set;
  parse_fields(command.text, set);
  std::string fields(command.text.data(), command.text.size());
  if (!set.has(StateField::safe)) fields += ",SAFE";
  if (!set.has(StateField::cmd)) fields += ",CMD";
  if (!set.has(StateField::relays) && options_.arming == Arming::required) fields += ",RELAYS";
  if (fields != fields_.fields()) fields_.choose(std::move(fields));
  return Command::fields(fields_.fields());
}

}  // namespace r4
