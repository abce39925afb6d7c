// SPDX-License-Identifier: GPL-3.0-or-later
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
      wiring_in_use_(crc_of(config.settings.site.wiring)),
      i2c_(config.i2c) {
  for (int i = 0; i < uart_channels; ++i) {
    uarts_[i] = config.uarts[i];
    if (uarts_[i] != nullptr) uarts_[i]->set_up(config.settings.uarts[i]);
  }
  setpoints_.settings = config.settings;
  authentication_.use(config.settings.site.keys);
  guard_.add_duty(loop_limit_ms);
}

std::uint8_t Application::add_port(Port& port) {
  if (port_count_ == max_ports) return no_port;
  ports_[port_count_].port = &port;
  return port_count_++;
}

// A new host may not know the packed form, so the board sends text until a host takes control.
void Application::tell_ports() {
  const bool packed = setpoints_.settings.pack && link_.has_owner();
  for (std::uint8_t i = 0; i < port_count_; ++i) {
    ports_[i].port->use_packed_form(packed);
  }
}

void Application::start(std::uint32_t now_ms) {
  hal_.make_safe();
  safety_.count_from(now_ms);  // the clock starts at a random value, so numbers differ at each boot
  turned_ms_ = now_ms;
  tell_ports();
  begin_devices(now_ms);
  if (observer_ != nullptr) {
    observer_->on_state(now_ms, BoardState::connecting, SafeReason::link);
    observer_->on_outputs(now_ms, outputs_);
  }
  poll(now_ms);
}

BoardState Application::state() const {
  if (link_.state() == BoardLinkState::connecting) return BoardState::connecting;
  return safety_.is_safe() ? BoardState::safe : BoardState::active;
}

void Application::receive(std::uint8_t port, std::uint32_t peer, Text bytes, std::uint32_t now_ms) {
  turn(now_ms);
  look_at_time(now_ms);  // a silent host is noticed before its next datagram
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
  const Verdict verdict = judge(port, kind, datagram, now_ms);
  const bool authentic = verdict == Verdict::authentic;
  speaker_.from = from;
  speaker_.sid = datagram.session_id();
  // A watcher on a bus may have the peer of a paper host in control, but has its own numbers.
  const bool counts = authentic && link_.is_session_of(speaker_) && datagram.has_pnum() &&
                      (speaker_.sid != no_session || !asks_to_watch(datagram));
  known_ = counts && paths_.count(from, datagram.pnum());
  switch (kind) {
    case MessageKind::host_heartbeat:
      if (authentic) {
        on_host_heartbeat(from, datagram, now_ms);
      } else if (rejected(verdict, now_ms)) {
        answer_heartbeat(from, now_ms);  // the answer carries the nonce
      }
      break;
    case MessageKind::command:
      on_command(from, datagram, verdict, now_ms);
      break;
    case MessageKind::board_heartbeat:
    case MessageKind::nack:
    case MessageKind::identity:
    case MessageKind::state:
      break;  // from another board
  }
}

// Datagrams that waited during a standstill arrived after the last turn, at an unknown time.
void Application::turn(std::uint32_t now_ms) {
  if (now_ms - turned_ms_ > standstill_ms) {
    for (PortSlot& slot : ports_) {
      if (!slot.behind) slot.waiting_ms = turned_ms_;  // else the time of earlier datagrams stays
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

std::uint32_t Application::waited_ms(std::uint8_t port, std::uint32_t now_ms) const {
  return ports_[port].behind ? now_ms - ports_[port].waiting_ms : 0;
}

// A host on the board's own cable can set the key, so the host needs no key.
Verdict Application::judge(std::uint8_t port, MessageKind kind, const Datagram& datagram,
                           std::uint32_t now_ms) {
  if (!authentication_.required() || ports_[port].port->may_configure()) return Verdict::authentic;
  const bool of_host = kind == MessageKind::host_heartbeat || kind == MessageKind::command;
  return of_host ? authentication_.verify(datagram, now_ms) : Verdict::missing;
}

bool Application::rejected(Verdict verdict, std::uint32_t now_ms) {
  if (observer_ != nullptr) observer_->on_rejected(now_ms, verdict);
  return authentication_.rejected(verdict);
}

void Application::hold_paths() {
  for (std::uint8_t i = 0; i < port_count_; ++i) {
    bool held = false;
    for (int path = 0; link_.has_owner() && path < paths_.size(); ++path) {
      if (paths_[path].port != i) continue;
      held ? ports_[i].port->also_hold(paths_[path].peer) : ports_[i].port->hold(paths_[path].peer);
      held = true;
    }
    if (!held) ports_[i].port->hold(everyone);
  }
}

void Application::on_path_heard(Source from, std::uint32_t now_ms) {
  if (!paths_.on_heartbeat(from, now_ms)) return;
  watchers_.end_of(from);
  link_.send_soon();  // the new path needs a heartbeat
  hold_paths();
  if (observer_ != nullptr) observer_->on_path(now_ms, from, true);
}

void Application::on_path_left(Source path, std::uint32_t now_ms) {
  hold_paths();
  if (observer_ != nullptr) observer_->on_path(now_ms, path, false);
}

void Application::on_host_found(Source at, std::uint32_t now_ms) {
  hold_paths();
  tell_ports();
  watchers_.end_of(at);
  safety_.leave(SafeReason::link);
  schedule_.start(now_ms, setpoints_.settings.state_period_ms());
}

void Application::on_host_heartbeat(Source from, const Datagram& datagram, std::uint32_t now_ms) {
  BoardLink::HostHeartbeat heartbeat;
  heartbeat.host = speaker_;
  heartbeat.has_pnum = datagram.has_pnum();
  heartbeat.pnum = datagram.pnum();
  heartbeat.t = datagram.time_ms();
  heartbeat.waited_ms = waited_ms(from.port, now_ms);
  switch (link_.on_heartbeat(heartbeat, now_ms)) {
    case HeartbeatEffect::fed:
    case HeartbeatEffect::repeated:
      on_path_heard(from, now_ms);
      break;
    case HeartbeatEffect::new_session:
      paths_.begin(from, now_ms);
      // Commands of another host, or of this host before its restart, must not take effect again.
      setpoints_.outputs = Outputs();
      setpoints_.fields = FieldSet::paper_default();
      begin_devices(now_ms);
      if (heartbeat.has_pnum) paths_.count(from, heartbeat.pnum);
      on_host_found(from, now_ms);
      break;
    case HeartbeatEffect::resumed:
      paths_.resume(from, now_ms);
      if (setpoints_.settings.recovery == Recovery::rearm) setpoints_.outputs = Outputs();
      forget_uarts();
      on_host_found(from, now_ms);
      break;
    case HeartbeatEffect::stale:
      break;
    case HeartbeatEffect::unheard:
      answer_heartbeat(from, now_ms);
      break;
    case HeartbeatEffect::busy:
      refuse(from, datagram, Refusal::busy, now_ms);
      break;
  }
  expect_host();
  poll(now_ms);
}

void Application::port_down(std::uint8_t port, std::uint32_t now_ms) {
  Source left;
  while (link_.has_owner() && paths_.take_port(port, left)) {
    if (paths_.size() == 0 && link_.lose(now_ms)) enter(SafeReason::link, now_ms);
    on_path_left(left, now_ms);
  }
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
  Source left;
  while (link_.has_owner() && paths_.take_silent(setpoints_.settings.timeout_ms, now_ms, left)) {
    on_path_left(left, now_ms);
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
