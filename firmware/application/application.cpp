// SPDX-License-Identifier: GPL-3.0-or-later
// What comes to the application: datagrams, and time.
#include "application.hpp"

namespace r4 {
namespace firmware {

BoardLink::Timing Application::timing_of(const Settings& settings) {
  BoardLink::Timing timing;
  timing.heartbeat_ms = settings.heartbeat_ms;
  timing.timeout_ms = settings.timeout_ms;
  return timing;
}

const char* to_text(BoardState state) {
  switch (state) {
    case BoardState::connecting:
      return "CONNECTING";
    case BoardState::active:
      return "ACTIVE";
    case BoardState::safe:
      return "SAFE";
  }
  return "unknown";
}

Application::Application(Hal& hal, const Config& config, Observer* observer)
    : hal_(hal),
      observer_(observer),
      identity_(config.identity),
      link_(timing_of(config.settings)),
      authentication_(config.chance),
      guard_(hal),
      i2c_(config.i2c) {
  for (int i = 0; i < uart_channels; ++i) {
    uarts_[i] = config.uarts[i];
    if (uarts_[i] != nullptr) uarts_[i]->set_up(config.settings.uarts[i]);
  }
  setpoints_.settings = config.settings;
  authentication_.use(config.settings.site.keys);
  guard_.add_duty(loop_limit_ms);  // loop_duty
}

std::uint8_t Application::add_port(Port& port) {
  if (port_count_ == max_ports) return no_port;
  ports_[port_count_].port = &port;
  return port_count_++;
}

// Who comes to a board without a host may know the text only, and wait for the board to speak first.
void Application::tell_ports() {
  const bool packed = setpoints_.settings.pack && link_.has_owner();
  for (std::uint8_t i = 0; i < port_count_; ++i) {
    ports_[i].port->use_packed_form(packed);
  }
}

void Application::start(std::uint32_t now_ms) {
  hal_.make_safe();
  safety_.count_from(now_ms);  // the clock begins at random
  turned_ms_ = now_ms;
  tell_ports();
  begin_devices(now_ms);
  if (observer_ != nullptr) {
    observer_->on_state(now_ms, BoardState::connecting, SafeReason::none);
    observer_->on_outputs(now_ms, outputs_);
  }
  poll(now_ms);
}

BoardState Application::state() const {
  if (link_.state() == BoardLinkState::connecting) return BoardState::connecting;
  return safety_.is_safe() ? BoardState::safe : BoardState::active;
}

// --- what comes in

void Application::receive(std::uint8_t port, std::uint32_t peer, Text bytes, std::uint32_t now_ms) {
  turn(now_ms);
  look_at_time(now_ms);  // silence counts before what ends it
  if (port >= port_count_) return;
  Datagram datagram;
  if (!read_datagram(bytes, datagram)) {
    ++rx_bad_;
    return;
  }
  ++rx_ok_;
  Source from;
  from.port = port;
  from.peer = peer;
  const MessageKind kind = kind_of(datagram);
  Verdict verdict = judge(port, kind, datagram, now_ms);
  const bool waits =
      kind == MessageKind::host_heartbeat && waits_to_join(from, datagram, verdict, now_ms);
  const bool ours = wires_.has(from);
  speaker_ = ours ? link_.owner() : from;
  // The wires of a session carry the same bytes, and the packet number sees to it that they take effect once.
  // From anywhere else a copy is a replay.
  if (verdict == Verdict::copy) verdict = ours ? Verdict::authentic : Verdict::replayed;
  const bool authentic = verdict == Verdict::authentic;
  // A watcher at the place of the host in control, as on a bus, has numbers of its own.
  const bool counts = authentic && ours && datagram.has_pnum() && !asks_to_watch(datagram);
  known_ = counts && wires_.count(from, datagram.pnum());
  switch (kind) {
    case MessageKind::host_heartbeat:
      if (waits) break;
      if (authentic) {
        on_host_heartbeat(from, datagram, now_ms);
      } else if (rejected(verdict, kind, now_ms)) {
        answer_heartbeat(from, now_ms);  // it tells the nonce
      }
      break;
    case MessageKind::command:
      on_command(from, datagram, verdict, now_ms);
      break;
    case MessageKind::board_heartbeat:
    case MessageKind::nack:
    case MessageKind::identity:
    case MessageKind::state:
      break;  // another board's talk
  }
}

// What arrives while the loop stands still waits in an interrupt's ring or in the system, which tell
// nothing of when it came: only that it was not there when the loop last looked.
void Application::turn(std::uint32_t now_ms) {
  if (now_ms - turned_ms_ > standstill_ms) {
    for (PortSlot& slot : ports_) {
      if (!slot.behind) slot.waiting_ms = turned_ms_;  // else what came before may wait still
      slot.behind = true;
    }
    any_behind_ = true;
    went_on_ms_ = now_ms;
  } else if (any_behind_ && now_ms - went_on_ms_ >= catch_up_ms) {
    for (PortSlot& slot : ports_) slot.behind = false;
    any_behind_ = false;
  }
  turned_ms_ = now_ms;
}

void Application::drained(std::uint8_t port) {
  if (port < port_count_) ports_[port].behind = false;
}

// For how long may what comes from that port now have waited?
std::uint32_t Application::waited_ms(std::uint8_t port, std::uint32_t now_ms) const {
  return ports_[port].behind ? now_ms - ports_[port].waiting_ms : 0;
}

// Is the datagram of a host that may command? Without a key all are, and at a cable of the board's
// own: who is there can set a key.
Verdict Application::judge(std::uint8_t port, MessageKind kind, const Datagram& datagram,
                           std::uint32_t now_ms) {
  if (!authentication_.required() || ports_[port].port->may_configure()) return Verdict::authentic;
  const bool of_host = kind == MessageKind::host_heartbeat || kind == MessageKind::command;
  return of_host ? authentication_.verify(datagram, now_ms) : Verdict::missing;
}

// It is dropped. True if it may be answered.
bool Application::rejected(Verdict verdict, MessageKind kind, std::uint32_t now_ms) {
  if (observer_ != nullptr) observer_->on_rejected(now_ms, verdict);
  return authentication_.rejected(verdict, kind == MessageKind::command, now_ms);
}

BoardLink::HostHeartbeat Application::heartbeat_of(Source from, const Datagram& datagram,
                                                   std::uint32_t now_ms) const {
  BoardLink::HostHeartbeat heartbeat;
  heartbeat.from = from;
  heartbeat.has_pnum = datagram.has_pnum();
  heartbeat.pnum = datagram.pnum();
  heartbeat.has_time = datagram.has_time();
  heartbeat.t = datagram.time_ms();
  heartbeat.waited_ms = waited_ms(from.port, now_ms);
  return heartbeat;
}

SessionWires::Heartbeat Application::bytes_of(const Datagram& datagram) {
  SessionWires::Heartbeat bytes;
  bytes.pnum = datagram.pnum();
  bytes.checksum = datagram.checksum();
  return bytes;
}

// Of a heartbeat from a place that is none of the session's: becomes it one of them? True: that will show.
bool Application::waits_to_join(Source from, const Datagram& datagram, Verdict verdict,
                                std::uint32_t now_ms) {
  if (verdict != Verdict::authentic && verdict != Verdict::copy) return false;
  if (!link_.has_echo_host() || wires_.has(from) || !datagram.has_pnum()) return false;
  const SessionWires::Stranger stranger = wires_.on_stranger(
      from, bytes_of(datagram), link_.newest_heartbeat(), setpoints_.settings.timeout_ms, now_ms);
  follow_wires(now_ms);
  return stranger == SessionWires::Stranger::waits;
}

// A wire has come or gone: who is told, and where the host is.
void Application::follow_wires(std::uint32_t now_ms) {
  SessionWires::Change change;
  bool any = false;
  while (wires_.take_change(change)) {
    any = true;
    if (change.joined) watchers_.end_of(change.at);
    if (change.joined) link_.send_soon();  // it is to hear from us
    if (observer_ != nullptr) observer_->on_wire(now_ms, change.at, change.joined);
  }
  if (!any) return;
  if (!wires_.has(link_.owner())) {
    if (stop_from_ == link_.owner()) stop_from_ = wires_[0];
    link_.move_owner(wires_[0]);
  }
  hold_wires();
}

// The places of the session's host are its own, whatever others send.
void Application::hold_wires() {
  for (std::uint8_t i = 0; i < port_count_; ++i) {
    bool held = false;
    for (int wire = 0; link_.has_owner() && wire < wires_.size(); ++wire) {
      if (wires_[wire].port != i) continue;
      held ? ports_[i].port->also_hold(wires_[wire].peer) : ports_[i].port->hold(wires_[wire].peer);
      held = true;
    }
    if (!held) ports_[i].port->hold(everyone);
  }
}

void Application::on_host_heartbeat(Source from, const Datagram& datagram, std::uint32_t now_ms) {
  const BoardLink::HostHeartbeat heartbeat = heartbeat_of(speaker_, datagram, now_ms);
  const std::uint32_t timeout_ms = setpoints_.settings.timeout_ms;
  switch (link_.on_heartbeat(heartbeat, now_ms)) {
    case HeartbeatEffect::fed:
      wires_.taken(from, bytes_of(datagram), timeout_ms, now_ms);
      break;
    case HeartbeatEffect::new_session:
      link_.move_owner(from);
      wires_.begin(from, bytes_of(datagram), now_ms);
      hold_wires();
      tell_ports();
      watchers_.end_of(from);
      // Nothing that another host, or this one before its restart, commanded may come back.
      setpoints_.outputs = Outputs();
      setpoints_.fields = FieldSet::paper_default();
      begin_devices(now_ms);
      update_outputs(now_ms);
      safety_.leave(SafeReason::link);
      if (heartbeat.has_pnum) wires_.count(from, heartbeat.pnum);
      schedule_.start(now_ms, setpoints_.settings.state_period_ms());
      break;
    case HeartbeatEffect::resumed:
      wires_.resume(now_ms);
      wires_.taken(from, bytes_of(datagram), timeout_ms, now_ms);
      hold_wires();
      tell_ports();
      for (int i = 0; i < wires_.size(); ++i) watchers_.end_of(wires_[i]);
      if (setpoints_.settings.recovery == Recovery::rearm) setpoints_.outputs = Outputs();
      forget_uarts();
      safety_.leave(SafeReason::link);
      schedule_.start(now_ms, setpoints_.settings.state_period_ms());
      break;
    case HeartbeatEffect::stale:
      wires_.passed_over(from, bytes_of(datagram), timeout_ms, now_ms);
      if (link_.wants_answer(heartbeat, now_ms)) {
        answer_heartbeat(from, now_ms);
      }
      break;
    case HeartbeatEffect::busy:
      refuse(from, datagram, Refusal::busy, now_ms);
      break;
  }
  follow_wires(now_ms);
  expect_host();
  poll(now_ms);
}

void Application::port_down(std::uint8_t port, std::uint32_t now_ms) {
  if (link_.has_owner() && wires_.port_lost(port)) return follow_wires(now_ms);
  if (link_.port_lost(port, now_ms)) enter(SafeReason::link, now_ms);
}

void Application::fail(SafeReason cause, std::uint32_t now_ms) {
  if (safety_.has(cause)) {
    safety_.again();
    link_.send_soon();
  }
  enter(cause, now_ms);
  caused_ms_ = now_ms;
}

std::uint32_t Application::poll(std::uint32_t now_ms) {
  guard_.check_in(loop_duty);
  turn(now_ms);
  look_at_time(now_ms);
  if (link_.has_owner()) {
    wires_.poll(setpoints_.settings.timeout_ms, now_ms);
    follow_wires(now_ms);
  }
  check_interlocks(now_ms);
  update_outputs(now_ms);
  report_state(now_ms);
  watchers_.poll(now_ms);
  poll_devices(now_ms);
  if (!link_.has_owner() && !watchers_.any()) schedule_.stop();
  send_states(now_ms);
  if (link_.heartbeat_due(now_ms)) send_heartbeats(now_ms);

  std::uint32_t due = link_.due_in(now_ms);
  if (schedule_.running() && schedule_.due_in(now_ms) < due) due = schedule_.due_in(now_ms);
  return due < interlock_period_ms ? due : interlock_period_ms;
}

}  // namespace firmware
}  // namespace r4
