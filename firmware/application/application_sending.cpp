// SPDX-License-Identifier: GPL-3.0-or-later
#include <cstring>

#include "../../protocol/messages/command_group.hpp"
#include "../../protocol/messages/state_fields.hpp"
#include "application.hpp"

namespace r4 {
namespace firmware {

namespace {

constexpr std::size_t short_datagram = 160;

// ";SAFE:6;FAULT:127,255" after the last field of a state.
constexpr std::size_t safe_fields_size = 22;

}  // namespace

// The controlling host's peer on this port; everyone if the host has no path on this port.
std::uint32_t Application::audience(std::uint8_t port) const {
  for (int i = 0; link_.has_owner() && i < paths_.size(); ++i) {
    if (paths_[i].port == port) return paths_[i].peer;
  }
  return everyone;
}

// Paths on one port share the port's numbers, so each path gets every datagram with such a number.
void Application::transmit(Source to, const std::uint32_t& number, Text datagram,
                           Priority priority) {
  PortSlot& slot = ports_[to.port];
  const bool shared = link_.has_owner() && &number == &slot.next_pnum;
  bool sent = false;
  for (int i = 0; shared && i < paths_.size(); ++i) {
    if (paths_[i].port != to.port) continue;
    slot.port->send(datagram, priority, paths_[i].peer);
    sent = true;
  }
  if (!sent) slot.port->send(datagram, priority, to.peer);
}

bool Application::is_of_owner() const { return link_.has_owner() && link_.is_session_of(speaker_); }

// A watcher has its own numbers. A sender that receives everything on the port gets the port's
// numbers. Other hosts have separate numbers, because they may use the same bridge.
std::uint32_t& Application::number_for(Source to) {
  Watcher* const watcher = watchers_.find(to);
  if (watcher != nullptr && !hears_all(to)) return watcher->pnum;
  const bool hears_session = is_of_owner() || speaker_.sid == no_session;
  const bool shared = !link_.has_owner() || (hears_session && paths_.has(to));
  return shared ? ports_[to.port].next_pnum : ports_[to.port].aside_pnum;
}

bool Application::reaches(Source watcher) const {
  return audience(watcher.port) == everyone && ports_[watcher.port].port->reaches(watcher.peer);
}

// True if the watcher receives all datagrams of its port, and so shares the port's numbers.
bool Application::hears_all(Source watcher) const {
  return link_.state() != BoardLinkState::connecting && reaches(watcher);
}

void Application::answer(Source to, DatagramWriter& writer, std::uint32_t now_ms) {
  std::uint32_t& number = number_for(to);
  const Text datagram = writer.finish(number++, now_ms);
  if (!datagram.empty()) transmit(to, number, datagram, Priority::normal);
}

BoardWiring Application::kept_wiring() const {
  BoardWiring kept;
  kept.source = settings().site.wiring_source;
  kept.wiring = settings().site.wiring;
  kept.in_use = crc_of(kept.wiring) == wiring_in_use_;
  return kept;
}

void Application::identify(Source to, const Datagram& question, bool with_wiring,
                           std::uint32_t now_ms) {
  const bool ours = is_of_owner();
  if (!ours && !questions_.take(now_ms)) return;
  char buffer[max_datagram];
  DatagramWriter writer(buffer, sizeof buffer);
  Identity identity = identity_;
  const char* const name = settings().site.name;
  identity.name = Text(name, std::strlen(name));
  identity.has_busy = true;
  identity.busy = link_.has_owner() && !ours;
  identity.has_asked = question.has_pnum();
  identity.asked = question.pnum();
  identity.sid = question.session_id();
  char wiring[max_board_wiring];
  if (with_wiring) identity.wiring = write_board_wiring(kept_wiring(), wiring);
  write_identity(writer, identity);
  writer.more("+").more(leave_capability).more("+").more(group_capability);
  if (authentication_.has_chance()) writer.more("+").more(watch_capability);
  if (i2c_ != nullptr) writer.more("+").more(i2c_capability);
  if (uarts_[0] != nullptr) writer.more("+").more(uart_capability);
  writer.more("+").more(dac_capability);
  write_identity_fields(writer, identity);
  answer(to, writer, now_ms);
}

// `at`: the command of a group, from 1; 0: none. `lease`: the number that a W must echo; 0: none.
void Application::refuse(Source to, const Datagram& datagram, Refusal code, std::uint32_t now_ms,
                         std::uint8_t at, std::uint32_t lease) {
  const bool counts = !known_ && lease == 0;  // with a lease, the board only asks for another W
  if (counts) ++rx_refused_;
  if (!datagram.has_pnum()) return;
  if (observer_ != nullptr && counts) observer_->on_refused(now_ms, datagram.pnum(), code);
  Nack nack;
  nack.pnum = datagram.pnum();
  nack.sid = datagram.session_id();
  nack.code = code;
  nack.at = at;
  // A W needs no key, so its answer must prove nothing about a command with the same number.
  nack.has_session = !asks_to_watch(datagram) && link_.first_heartbeat(speaker_, nack.session);
  nack.lease = lease;
  char buffer[short_datagram];
  DatagramWriter writer(buffer, sizeof buffer);
  write_nack(writer, nack);
  answer(to, writer, now_ms);
}

// The time in a heartbeat. An echo of 0 means that the host has received no T, so 0 is skipped.
std::uint32_t Application::heartbeat_time(std::uint32_t now_ms) {
  return now_ms != 0 ? now_ms : 0xFFFFFFFFU;
}

SafeReport Application::safe_report() const {
  SafeReport report(safety_.reason());
  if (safety_.latched()) report.cause = safety_.newest();
  report.has_stop = has_stop_number_ && safety_.has(SafeReason::stop);
  report.stop = stop_number_;
  return report;
}

void Application::send_heartbeats(std::uint32_t now_ms) {
  for (std::uint8_t i = 0; i < port_count_; ++i) {
    Source to;
    to.port = i;
    to.peer = audience(i);
    send_heartbeat(to, now_ms);
  }
  for (Watcher& watcher : watchers_) {
    if (watcher.period_ms != 0 && !reaches(watcher.at)) {
      write_heartbeat(watcher.at, watcher.pnum, heartbeat_time(now_ms), safe_report());
    }
  }
  link_.heartbeat_sent(heartbeat_time(now_ms));
}

// For a sender without a T to echo: it can echo this heartbeat, even in CONNECTING.
void Application::answer_heartbeat(Source to, std::uint32_t now_ms) {
  write_heartbeat(to, number_for(to), link_.answer_time(heartbeat_time(now_ms)), safe_report());
}

// In CONNECTING the heartbeat is the paper's: PNum 0, without SAFE:1. Numbers restart after it.
void Application::send_heartbeat(Source to, std::uint32_t now_ms) {
  std::uint32_t& pnum = ports_[to.port].next_pnum;
  if (link_.state() != BoardLinkState::connecting) {
    return write_heartbeat(to, pnum, heartbeat_time(now_ms), safe_report());
  }
  char buffer[short_datagram];
  SafeReport safe = safe_report();
  if (safe.reason == SafeReason::link) safe = SafeReport();
  const Text nonce = authentication_.nonce();
  const std::uint32_t t_ms = nonce.empty() ? 0 : heartbeat_time(now_ms);
  ports_[to.port].port->send(write_board_heartbeat(buffer, sizeof buffer, 0, t_ms, safe, nonce),
                             Priority::normal, to.peer);
  pnum = 1;
}

void Application::write_heartbeat(Source to, std::uint32_t& pnum, std::uint32_t t_ms,
                                  const SafeReport& safe) {
  char buffer[short_datagram];
  const Text nonce = authentication_.nonce();
  if (pnum == 0 && !nonce.empty()) ++pnum;  // 0 would mean CONNECTING
  link_.shown(t_ms);
  transmit(to, pnum, write_board_heartbeat(buffer, sizeof buffer, pnum++, t_ms, safe, nonce),
           Priority::normal);
}

void Application::send_states(std::uint32_t now_ms) {
  std::uint32_t t_ms = 0;
  if (!schedule_.take(now_ms, t_ms)) return;
  for (UserUart* uart : uarts_) {
    if (uart != nullptr) uart->next_state();
  }
  State state;
  fill(state);
  FieldSet chosen = setpoints_.fields;
  add_device_answer(chosen, t_ms);
  if (link_.has_owner()) {
    for (std::uint8_t i = 0; i < port_count_; ++i) {
      Source to;
      to.port = i;
      to.peer = audience(i);
      send_state(to, ports_[i].next_pnum, chosen, state, t_ms);
    }
  }
  for (Watcher& watcher : watchers_) {
    if (watcher.period_ms == 0 || !watcher.take(t_ms)) continue;
    if (link_.has_owner() && reaches(watcher.at)) continue;
    const FieldSet& fields = watcher.chooses ? watcher.fields : chosen;
    std::uint32_t& pnum = hears_all(watcher.at) ? ports_[watcher.at.port].next_pnum : watcher.pnum;
    send_state(watcher.at, pnum, fields, state, t_ms);
  }
}

void Application::send_state(Source to, std::uint32_t& pnum, FieldSet fields, const State& state,
                             std::uint32_t t_ms) {
  char buffer[max_datagram];
  const std::size_t carried = ports_[to.port].port->max_size();
  const std::size_t limit = carried < sizeof buffer ? carried : sizeof buffer;
  const std::size_t room = limit - DatagramWriter::trailer_max - safe_fields_size;
  if (state.safe != SafeReason::none) {  // send_part() adds the safe fields to every part
    fields.remove(StateField::safe);
    fields.remove(StateField::fault);
  }
  DatagramWriter writer(buffer, limit);
  for (int i = 0; i < state_field_count; ++i) {
    const StateField field = static_cast<StateField>(i);
    if (!fields.has(field)) continue;
    const std::size_t before = writer.size();
    write_field(writer, field, state);
    if (writer.ok() && writer.size() <= room) continue;
    writer.truncate(before);
    send_part(to, pnum, writer, state, t_ms);
    writer = DatagramWriter(buffer, limit);
    write_field(writer, field, state);
  }
  send_part(to, pnum, writer, state, t_ms);
}

void Application::send_part(Source to, std::uint32_t& pnum, DatagramWriter& writer,
                            const State& state, std::uint32_t t_ms) {
  if (state.safe != SafeReason::none) write_field(writer, StateField::safe, state);
  if (state.safe != SafeReason::none && state.fault.any()) {
    write_field(writer, StateField::fault, state);
  }
  transmit(to, pnum, writer.finish(pnum++, t_ms), Priority::state);
}

void Application::fill(State& state) const {
  for (int i = 0; i < analog_channels; ++i) state.raw.analog_cv[i] = inputs_.analog_cv[i];
  state.handle = inputs_.handle;
#define R4_OUTPUT(kind, Value, member, channels, ...) \
  for (int i = 0; i < (channels); ++i) state.raw.member[i] = outputs_.member[i];
#include "r4link/tables/board.def"
  state.relays = outputs_.relays;
  state.gpio = inputs_.gpio;
  for (int i = 0; i < stepper_channels; ++i) state.raw.stepper_steps[i] = inputs_.stepper_steps[i];
  for (int i = 0; i < encoder_channels; ++i) {
    state.raw.encoder_counts[i] = inputs_.encoder_counts[i];
    state.raw.encoder_hz[i] = inputs_.encoder_hz[i];
    state.raw.encoder_index_counts[i] = inputs_.encoder_index_counts[i];
  }
  for (int i = 0; i < ultrasonic_channels; ++i)
    state.raw.ultrasonic_cm[i] = inputs_.ultrasonic_cm[i];
  state.safe = safety_.reason();
  state.last_command = link_.last_executed();
  state.rx_ok = rx_ok_;
  state.rx_crc = rx_bad_;
  state.rx_lost = paths_.lost();
  state.rx_duplicate = paths_.repeated();
  state.rx_refused = rx_refused_;
  state.late = schedule_.late();
  state.fault = inputs_.fault;
  fill_devices(state);
}

}  // namespace firmware
}  // namespace r4
