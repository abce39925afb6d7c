// SPDX-License-Identifier: GPL-3.0-or-later
// The datagrams of the board. Each function first decides whether the datagram counts, then updates
// the board and the link, then the commands, and then reports.
#include "../../protocol/link/board_link.hpp"
#include "session.hpp"

namespace r4 {

void Session::receive(std::size_t path, std::string_view bytes, Time now) {
  Datagram& datagram = effects_.datagram();
  const ReadResult result = read_datagram(bytes, datagram);
  if (!result) {
    ++statistics_.counts.damaged;
    effects_.report(BadDatagramCame{result, bytes});
    return;
  }
  const MessageKind kind = kind_of(datagram);
  const bool from_board = kind == MessageKind::board_heartbeat || kind == MessageKind::nack ||
                          kind == MessageKind::identity || kind == MessageKind::state;
  if (!from_board || !datagram.has_pnum() || !datagram.has_time()) return;
  ++statistics_.counts.received;
  switch (kind) {
    case MessageKind::nack:
      return on_refusal(path, datagram, now);
    case MessageKind::identity:
      return on_identity(path, datagram, now);
    case MessageKind::board_heartbeat:
      return on_heartbeat(path, datagram, now);
    default:
      return on_state(path, datagram, now);
  }
}

bool Session::admitted(Paths::Admission admission, Time now) {
  if (admission == Paths::Admission::restarted) on_restart(now);
  return admission != Paths::Admission::no;
}

void Session::on_state(std::size_t path, const Datagram& datagram, Time now) {
  const auto t_ms = static_cast<std::uint32_t>(datagram.time_ms());
  if (!admitted(paths_.admit(path, datagram.pnum(), t_ms, now), now)) return;
  link_.on_heard(to_ms(now));
  paths_.lease(path).on_state(now);
  if (!paths_.news().is_newest_state(path, t_ms)) return refresh(now);
  ReceivedState fresh = state();
  if (!read_state(datagram, fresh)) {
    ++statistics_.counts.damaged;
    effects_.report(BadDatagramCame{{.error = ReadError::syntax},
                                    {datagram.bytes().data(), datagram.bytes().size()}});
    return refresh(now);
  }
  if (!paths_.news().take_state(path, t_ms, fresh.present)) return refresh(now);

  const SafeReason reason = fresh.present.has(StateField::safe) ? fresh.safe : SafeReason::none;
  statistics_.on_state(fresh.t_ms, now);
  // If a heartbeat has overtaken this state, the heartbeat's reason is newer.
  const bool newest = paths_.is_newest(path, t_ms, now);
  if (newest) {
    link_.on_reason(reason, to_ms(now));
    key_.on_board_time(fresh.t_ms, now);
    key_.on_host_seen(now);
  }
  board_.on_state(fresh, newest ? std::optional(reason) : std::nullopt, now);
  refresh(now);

  if (board_.confirms()) {
    keeper_.fields().on_cmd(now);
    const bool ours = link_.is_taken(state().last_command);
    if (keeper_.is_up() && ours) keeper_.on_own_command(t_ms, now);
  }
  commands_.on_state(now);
  take_step_end(now);
  const std::optional<bool> supply_closed = board_.supply();
  if (newest && keeper_.is_up() && supply_closed) arming_.on_supply(*supply_closed);
  keeper_.select_fields(now);
  if (keeper_.in_control(now) != status_.in_control) refresh(now);
  effects_.report(StateCame{});
}

void Session::on_heartbeat(std::size_t path, const Datagram& datagram, Time now) {
  const bool booting = is_connecting_heartbeat(datagram);
  const SafeReport report = heartbeat_report(datagram);
  const auto t_ms = static_cast<std::uint32_t>(datagram.time_ms());
  bool taken = false;
  if (booting) {
    // On a bus, a watcher also receives this heartbeat for hosts, and uses the states instead.
    const bool for_hosts = watches() && paths_.streaming(now);
    taken = !for_hosts && paths_.admit_connecting(path, now);
  } else {
    taken = admitted(paths_.admit(path, datagram.pnum(), t_ms, now), now) &&
            paths_.news().take_heartbeat(path, t_ms);
  }
  if (!taken) {
    if (paths_.is_known(path)) commands_.on_stop(report, now);  // the stop's number proves the stop
    return refresh(now);
  }
  const bool newest = booting || paths_.is_newest(path, t_ms, now);
  if (booting) {
    link_.on_booting(report.reason, to_ms(now));
  } else {
    link_.on_heartbeat(t_ms);
    newest ? link_.on_reason(report.reason, to_ms(now)) : link_.on_heard(to_ms(now));
  }
  effects_.report(HeartbeatCame{});
  if (!newest) return refresh(now);

  const std::optional<std::uint32_t> board_ms = booting ? std::nullopt : std::optional(t_ms);
  board_.on_heartbeat(report.reason, board_ms, now);
  key_.on_heartbeat(datagram);
  key_.on_board_time(t_ms, now);
  key_.on_reason(booting ? SafeReason::link : report.reason, now);
  if (key_.asked_for()) keeper_.fields().on_answer();
  refresh(now);
  arming_.on_cause(report.cause, now);
  commands_.on_heartbeat(report, board_ms, now);
}

void Session::on_identity(std::size_t path, const Datagram& datagram, Time now) {
  Identity identity;
  if (!read_identity(datagram, identity)) return;
  if (!watches() && identity.sid != outbox_.session_id()) return;
  const auto t_ms = static_cast<std::uint32_t>(datagram.time_ms());
  if (!admitted(paths_.admit_identity(path, identity, t_ms, now), now)) return refresh(now);
  // Answers to hosts without control are not numbered with the states.
  const bool to_watcher = watches() && identity.sid == no_session;
  const bool counts = to_watcher || !(identity.has_busy && identity.busy);
  paths_.admit_answer(path, datagram.pnum(), t_ms, counts, now);
  if (counts) link_.on_heard(to_ms(now));
  keeper_.fields().on_answer();
  if (const auto asked = board_.on_identity(identity, t_ms, now)) {
    statistics_.on_round_trip(now - *asked);
  }
  effects_.report(identity);
  refresh(now);
  commands_.on_identity(identity, now);
}

void Session::on_refusal(std::size_t path, const Datagram& datagram, Time now) {
  Nack nack;
  if (!read_nack(datagram, nack)) return;
  const auto t_ms = static_cast<std::uint32_t>(datagram.time_ms());
  if (!paths_.admit_answer(path, datagram.pnum(), t_ms, nack.has_session, now)) return;
  if (nack.sid != outbox_.session_id() || !link_.is_taken(nack.pnum)) {
    // A watcher receives answers to other hosts on a bus, on a shared transport and in a recording.
    if (watches() && nack.has_session) link_.on_heard(to_ms(now));
    return refresh(now);
  }
  link_.on_heard(to_ms(now));
  if (watches()) {
    // A board refuses no other command of a watcher. The link's status reports the codes below.
    paths_.lease(path).on_refusal(nack, now);
    const bool in_status =
        nack.code == Refusal::stale || nack.code == Refusal::busy || nack.code == Refusal::unknown;
    if (!in_status) effects_.report(nack);
    return refresh(now);
  }
  keeper_.fields().on_answer();
  if (nack.code == Refusal::busy) {
    keeper_.on_busy(path, t_ms, now);
    key_.on_host_seen(now);
  }
  const bool not_taken = nack.code == Refusal::auth && !commands_.is_cable_only(nack.pnum);
  if (not_taken) key_.on_refusal(now);
  if (!paths_.news().is_copy(nack)) effects_.report(nack);
  // AUTH refuses one duplicate. A repetition may have been executed, and so may a duplicate on
  // another path, even if that path is down by now.
  const bool other_copy =
      nack.code == Refusal::auth && ((not_taken && key_.has_key()) || paths_.count() > 1);
  const bool proof = !other_copy && is_proof(nack);
  const bool others = (paths_.speaking() & ~path_bit(path)) != 0;
  commands_.on_refusal(nack, proof, others, now);
  take_step_end(now);
  if (proof) posts_.on_refusal(nack);
  refresh(now);
}

// True if the refusal proves that the command was not executed. The board remembers a limited
// number of executed commands of one session. Without proof, the deadline decides.
bool Session::is_proof(const Nack& nack) const {
  // Distances to the newest number, because a session may be older than half of all numbers.
  const std::uint32_t since_command = link_.last_pnum() - nack.pnum;
  const std::uint32_t since_session = link_.last_pnum() - nack.session;
  return nack.has_session && link_.is_taken(nack.session) && since_session > since_command &&
         since_command < BoardLink::memory;
}

void Session::take_step_end(Time now) {
  const std::optional<CommandsUnderWay::StepEnd> step = commands_.take_step_end();
  if (!step) return;
  arming_.on_step(step->kind, step->result, link_.reason(), board_.supply_is_open(), now);
}

}  // namespace r4
