// SPDX-License-Identifier: GPL-3.0-or-later
#include "../../protocol/messages/command_field.hpp"
#include "../../protocol/messages/command_group.hpp"
#include "../../protocol/messages/device_command.hpp"
#include "application.hpp"

namespace r4 {
namespace firmware {

// False if the datagram was answered or dropped. `at`: the group's command that caused `refusal`.
bool Application::admit(Source from, const Datagram& datagram, Verdict verdict, Refusal refusal,
                        std::uint8_t at, std::uint32_t now_ms) {
  if (verdict != Verdict::authentic) {
    if (rejected(verdict, now_ms)) {
      refuse(from, datagram, Refusal::auth, now_ms);
    } else {
      ++rx_refused_;
    }
    return false;
  }
  if (!datagram.has_pnum()) {  // a command needs a number to be executed once, and to be answered
    ++rx_refused_;
    return false;
  }
  if (refusal != Refusal::none) {
    refuse(from, datagram, refusal, now_ms, at);
    return false;
  }
  const Refusal code = link_.admit(speaker_, datagram.pnum(), now_ms);
  if (code == Refusal::none) return true;
  if (code == Refusal::safe) link_.refused(speaker_, datagram.pnum(), code);
  refuse(from, datagram, code, now_ms);
  return false;
}

void Application::on_command(Source from, const Datagram& datagram, Verdict verdict,
                             std::uint32_t now_ms) {
  const int count = datagram.command_count();
  const Field& field = datagram.command();
  // A stop is obeyed even among other commands. A single command of another letter is not a stop.
  if ((count != 1 || field.name() == "E") && asks_to_stop(datagram)) {
    emergency_stop(from, datagram, verdict, now_ms);
    return;
  }
  if (count != 1) {
    on_group(from, datagram, verdict, now_ms);
    return;
  }
  Command command;
  const Refusal refusal = parse_command(field, command);
  if (refusal == Refusal::none && is_question(command.kind)) {
    const bool asks_wiring = command.kind == CommandKind::ask_wiring;
    if (asks_wiring && !ports_[from.port].port->may_configure()) {
      return refuse(from, datagram, Refusal::auth, now_ms);
    }
    return identify(from, datagram, asks_wiring, now_ms);
  }
  if (refusal == Refusal::none && command.kind == CommandKind::watch) {
    on_watch(from, datagram, command, now_ms);
    return;
  }
  if (!admit(from, datagram, verdict, refusal, 0, now_ms)) return;
  Refusal outcome = Refusal::none;
  if (drives_output(command.kind) && safety_.is_safe()) {
    outcome = Refusal::safe;
  } else if (command.kind == CommandKind::clear) {
    outcome = judge_clear(command, waited_ms(from.port, now_ms), now_ms);
  } else if (command.kind == CommandKind::leave) {
    if (speaker_.sid == no_session) outcome = Refusal::unknown;  // a paper host has no sessions
  } else if (!may_set(from.port, command)) {
    outcome = Refusal::auth;
  } else if (is_device_command(command.kind)) {
    outcome = carry_out_device(datagram.pnum(), command, now_ms);
  } else {
    outcome = carry_out(command, setpoints_);
  }
  if (outcome != Refusal::none) {
    link_.refused(speaker_, datagram.pnum(), outcome);
    refuse(from, datagram, outcome, now_ms);
    return;
  }
  execute(datagram.pnum(), command, now_ms);
}

void Application::on_group(Source from, const Datagram& datagram, Verdict verdict,
                           std::uint32_t now_ms) {
  CommandGroup group;
  std::uint8_t at = 0;
  const Refusal refusal = read_group(datagram, group, at);
  if (!admit(from, datagram, verdict, refusal, at, now_ms)) return;
  if (safety_.is_safe()) {
    link_.refused(speaker_, datagram.pnum(), Refusal::safe);
    refuse(from, datagram, Refusal::safe, now_ms);
    return;
  }
  link_.executed(datagram.pnum());
  for (const Command& command : group) {
    carry_out(command, setpoints_);  // cannot fail: read_group() has checked it
    take_effect(datagram.pnum(), command, now_ms);
  }
  bring_about(now_ms);
}

// Needs no key, even on a board with a key: states are not secret, and a watcher commands nothing.
void Application::on_watch(Source from, const Datagram& datagram, const Command& command,
                           std::uint32_t now_ms) {
  const bool proven = ports_[from.port].port->is_bus();
  if (!proven && !authentication_.has_chance()) {
    return refuse(from, datagram, Refusal::unknown, now_ms);
  }
  FieldSet fields;
  if (!command.text.empty()) {
    const Refusal refusal = parse_fields(command.text, fields);
    if (refusal != Refusal::none) return refuse(from, datagram, refusal, now_ms);
  }
  if (link_.has_owner() && paths_.has(from)) return;  // the path gets all states already
  const std::uint32_t rate_hz = static_cast<std::uint32_t>(command.value);
  switch (watchers_.on_lease(from, rate_hz, datagram.time_ms(), proven, now_ms)) {
    case Watchers::Effect::watching: {
      Watcher& watcher = *watchers_.find(from);
      watcher.chooses = !command.text.empty();
      watcher.fields = fields;
      if (!schedule_.running()) schedule_.start(now_ms, setpoints_.settings.state_period_ms());
      break;
    }
    case Watchers::Effect::unproven: {
      const std::uint32_t token = authentication_.random();
      watchers_.tell(from, token, now_ms);
      refuse(from, datagram, Refusal::stale, now_ms, 0, token);
      break;
    }
    case Watchers::Effect::full:
      refuse(from, datagram, Refusal::busy, now_ms);
      break;
    case Watchers::Effect::ended:
    case Watchers::Effect::ignored:
      break;
  }
}

bool Application::may_set(std::uint8_t port, const Command& command) const {
  return command.kind != CommandKind::setting || !is_site_setting(command.text) ||
         ports_[port].port->may_configure();
}

void Application::execute(std::uint32_t pnum, const Command& command, std::uint32_t now_ms) {
  link_.executed(pnum);
  take_effect(pnum, command, now_ms);
  bring_about(now_ms);
}

void Application::take_effect(std::uint32_t pnum, const Command& command, std::uint32_t now_ms) {
  switch (command.kind) {
    case CommandKind::zero:
      hal_.zero(command.channel);
      rezeroed_ = true;
      break;
    case CommandKind::clear:
      clear();
      break;
    case CommandKind::leave:
      link_.leave(now_ms);
      setpoints_.outputs = Outputs();
      enter(SafeReason::link, now_ms);
      break;
    case CommandKind::setting:
      follow_device_setting(command.text, now_ms);
      if (command.text == row_of(Setting::key).key)
        authentication_.use(setpoints_.settings.site.keys);
      link_.set_timing(timing_of(setpoints_.settings));
      expect_host();
      schedule_.set_period(setpoints_.settings.state_period_ms());
      tell_ports();
      break;
    default:
      break;
  }
  if (observer_ != nullptr) observer_->on_executed(now_ms, pnum, command);
}

void Application::bring_about(std::uint32_t now_ms) {
  look_at_time(now_ms);  // the silence may already exceed a new timeout
  check_interlocks(now_ms);
  update_outputs(now_ms);
  report_state(now_ms);
}

// A stop of the controlling host uses up its number only if the stop is authentic and its number is
// one of the next. Otherwise CMD would confirm a command that was not executed. Another program at
// the host's peer (a bus, or a shared port) has random numbers, which must not replace the host's.
void Application::emergency_stop(Source from, const Datagram& datagram, Verdict verdict,
                                 std::uint32_t now_ms) {
  const bool repeated = safety_.has(SafeReason::stop);
  std::uint32_t number = 0;
  const bool has_number = stop_number(datagram, number);
  // A stop with a key does not repeat a stop with the same number that was sent without a key.
  const bool of_a_key =
      verdict == Verdict::authentic || verdict == Verdict::replayed || verdict == Verdict::old;
  const bool same = has_number && has_stop_number_ && number == stop_number_ &&
                    speaker_ == stop_from_ && (stop_of_a_key_ || !of_a_key);
  // An E:CLEAR that is under way must not end this stop.
  if (repeated && !same) safety_.again();
  if (unread_stops_ != 0) --unread_stops_;
  if (!repeated || !same) stop_of_a_key_ = of_a_key;
  stop_from_ = speaker_;
  has_stop_number_ = has_number;
  stop_number_ = number;
  enter(SafeReason::stop, now_ms);
  caused_ms_ = now_ms;
  const bool owner = is_of_owner();
  if (owner && verdict == Verdict::authentic && datagram.has_pnum() &&
      link_.is_next(datagram.pnum()) &&
      link_.admit(speaker_, datagram.pnum(), now_ms) == Refusal::none) {
    link_.executed(datagram.pnum());
  }
  if (observer_ != nullptr) observer_->on_executed(now_ms, datagram.pnum(), Command::stop());
  if (!repeated) send_heartbeats(now_ms);
  if (repeated || !owner) answer_heartbeat(from, now_ms);
}

}  // namespace firmware
}  // namespace r4
