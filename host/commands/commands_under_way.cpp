// SPDX-License-Identifier: GPL-3.0-or-later
#include "commands_under_way.hpp"

#include <algorithm>

#include "../../protocol/messages/command_field.hpp"
#include "../../protocol/messages/site_settings.hpp"
#include "r4link/tables/commands.hpp"
#include "switches_off.hpp"

namespace r4 {

namespace {

// Commands that switch outputs off are repeated quickly, even while heartbeats are held back.
bool is_urgent(CommandKind kind) { return kind == CommandKind::stop || kind == CommandKind::leave; }

constexpr Time no_deadline = std::chrono::hours{24};

}  // namespace

CommandsUnderWay::CommandsUnderWay(const SessionOptions& options, HostLink& link,
                                   LinkKeeper& keeper, Outbox& outbox, HeardBoard& board,
                                   const ArmRequests& arming, Effects& effects, Statistics& counts)
    : options_(options),
      link_(link),
      keeper_(keeper),
      outbox_(outbox),
      board_(board),
      arming_(arming),
      effects_(effects),
      counts_(counts),
      pending_(max_pending, max_stops) {}

CommandsUnderWay::Pending* CommandsUnderWay::allocate(const Command& command, Time timeout,
                                                      Time now) {
  Pending* const slot = pending_.add(command.kind);
  if (slot == nullptr) return nullptr;
  DatagramWriter writer(slot->bytes.data(), slot->bytes.size());
  write_command(writer, command);
  slot->size = writer.size();
  slot->command = command;
  slot->cable_only = command.kind == CommandKind::setting && is_site_setting(command.text);
  slot->command.text = slot->command.text2 = Text();
  slot->ticket = next_ticket_++;
  slot->started = now;
  slot->deadline = now + timeout;
  if (command.kind == CommandKind::clear) {
    slot->cause = command.value;
    name_cause(*slot);
    forget_stop();  // the E:CLEAR clears the stop
  }
  return slot;
}

// Sets the present cause in an E:CLEAR without a cause. False before the first heartbeat.
bool CommandsUnderWay::name_cause(Pending& pending) const {
  if (pending.cause == Command::unnamed_cause) pending.cause = cause_;
  if (pending.cause == Command::unnamed_cause) return false;
  if (pending.stage == Stage::queued) {
    DatagramWriter writer(pending.bytes.data(), pending.bytes.size());
    write_command(writer, Command::clear(pending.cause));
    pending.size = writer.size();
  }
  return true;
}

Ticket CommandsUnderWay::send(const Command& command, Time timeout, Time now) {
  switch (command.kind) {
    case CommandKind::stop:
      return stop(timeout, now);
    case CommandKind::identify:
    case CommandKind::ask_wiring:
      return send_at_once(command, timeout, now);
    default:
      return queue(allocate(command, timeout, now), now);
  }
}

Ticket CommandsUnderWay::send(const Setpoints& group, Time timeout, Time now) {
  if (group.size() == 1) return send(group[0], timeout, now);
  Pending* const pending = allocate(group[0], timeout, now);
  if (pending != nullptr) pending->group = group;
  return queue(pending, now);
}

Ticket CommandsUnderWay::queue(Pending* pending, Time now) {
  if (pending == nullptr) return 0;
  ++counts_.commands;
  const Ticket ticket = pending->ticket;
  send_queued(now);
  return ticket;
}

Ticket CommandsUnderWay::send_at_once(const Command& command, Time timeout, Time now) {
  Pending* const pending = allocate(command, timeout, now);
  if (pending == nullptr) return 0;
  transmit(*pending, now);
  return pending->ticket;
}

Ticket CommandsUnderWay::stop(Time timeout, Time now) {
  forget_stop();
  ++counts_.commands;
  const Ticket ticket = send_at_once(Command::stop(), timeout, now);
  if (ticket == 0) outbox_.send(Command::stop(), {}, now);
  return ticket;
}

Ticket CommandsUnderWay::leave(Time timeout, Time now) {
  farewell_ = {now, {}};
  if (board_.state().any()) farewell_.state_ms = board_.state().t_ms;
  const Ticket ticket = send_at_once(Command::leave(), timeout, now);
  if (ticket != 0) ++counts_.commands;
  return ticket;
}

bool CommandsUnderWay::send_step(const Command& command, Time now) {
  Pending* const pending = allocate(command, no_deadline, now);  // arm() has the deadline
  if (pending == nullptr) return false;
  pending->is_step = true;
  transmit(*pending, now);
  return true;
}

void CommandsUnderWay::transmit(Pending& pending, Time now) {
  if (pending.stage == Stage::queued) {
    if (pending.is_group()) write_group(pending);
    pending.pnum = link_.take_pnum();
    DatagramWriter writer(pending.bytes.data(), pending.bytes.size(), pending.size);
    outbox_.stamp(writer, pending.kind, pending.pnum, to_ms(now));
    pending.size = writer.size();
    pending.stage = Stage::sent;
    if (is_question(pending.kind)) board_.asked(pending.pnum, now);
  } else {
    ++counts_.retries;
  }
  pending.retry =
      now + (is_urgent(pending.kind) ? Time{options_.stop_retry} : Time{options_.command_retry});
  DatagramWriter writer(pending.bytes.data(), pending.bytes.size(), pending.size);
  outbox_.send(writer, pending.kind, pending.pnum, {}, now);
}

void CommandsUnderWay::send_queued(Time now) {
  group_waits_ = false;
  if (!keeper_.in_control(now)) return;
  for (Pending& pending : pending_.under_way()) {
    if (pending.ticket > arming_.first()) return;
    if (pending.stage == Stage::queued && !is_held_back(pending.kind) && now < pending.deadline) {
      if (pending.is_group() && !choose_form(pending, now)) return;
      transmit(pending, now);
    }
    if (pending.has_more()) return;
  }
}

void CommandsUnderWay::repeat(Time now) {
  const bool gated = link_.gated(to_ms(now));
  for (Pending& pending : pending_.under_way()) {
    if (pending.stage == Stage::queued || now < pending.retry) continue;
    const bool off =
        pending.is_group() ? switches_off(pending.group) : switches_off(pending.command);
    if (is_held_back(pending.kind) && !pending.is_step && !off) {
      // A repetition could drive an output after the cause that disarmed the program has ended.
      finish(pending, Outcome::cancelled, Refusal::none, now);
    } else if (gated && !is_urgent(pending.kind)) {
      pending.retry = now + options_.command_retry;
    } else {
      transmit(pending, now);
    }
  }
}

Time CommandsUnderWay::next() {
  Time next = Time::max();
  for (const Pending& pending : pending_.under_way()) {
    next = std::min(next, pending.deadline);
    if (pending.stage != Stage::queued) next = std::min(next, pending.retry);
  }
  if (group_waits_) next = std::min(next, board_.groups().next());
  return next;
}

bool CommandsUnderWay::knows_groups(Time now) {
  if (board_.groups().ask(keeper_.fields().answers(), now)) {
    board_.asked(outbox_.send(Command::identify(), {}, now).pnum, now);
  }
  return board_.groups().state() != GroupSupport::State::unknown;
}

// Chooses one datagram or single commands for a group. False if unknown: the group waits.
bool CommandsUnderWay::choose_form(Pending& pending, Time now) {
  if (pending.step != 0) return true;
  if (!knows_groups(now)) {
    group_waits_ = true;
    return false;
  }
  if (board_.groups().state() == GroupSupport::State::apart) pending.step = 1;
  return true;
}

void CommandsUnderWay::write_group(Pending& pending) {
  DatagramWriter writer(pending.bytes.data(), pending.bytes.size());
  if (pending.step != 0) {
    pending.command = pending.group[pending.step - 1U];
    write_command(writer, pending.command);
  } else {
    for (std::size_t i = 0; i < pending.group.size(); ++i) write_command(writer, pending.group[i]);
  }
  pending.size = writer.size();
}

bool CommandsUnderWay::is_group_ahead() {
  if (group_waits_) return true;
  for (const Pending& pending : pending_.under_way()) {
    if (pending.has_more()) return true;
  }
  return false;
}

void CommandsUnderWay::finish(Pending& pending, Outcome outcome, Refusal code, Time now) {
  if (pending.stage == Stage::lingering) return pending_.remove(pending);  // the end was reported
  CommandResult result{outcome, code, now - pending.started,
                       outcome == Outcome::not_armed ? arming_.cause() : DisarmCause::none};
  if (pending.is_step) {
    step_end_ = {pending.kind, result};
    pending_.remove(pending);
    return;
  }
  if (outcome == Outcome::confirmed && pending.has_more()) {
    ++pending.step;
    pending.stage = Stage::queued;  // the next command gets a new number
    return;
  }
  result.pnum = pending.pnum;
  if (outcome != Outcome::confirmed) {
    result.at = pending.step != 0 ? pending.step : pending.failed;
    if (pending.step != 0) result.executed = static_cast<std::uint8_t>(pending.step - 1);
  }
  effects_.end(pending.ticket, result, counts_);
  const bool failed = outcome == Outcome::timed_out;
  if (pending.kind == CommandKind::stop && (failed || outcome == Outcome::confirmed)) {
    forget_stop();  // at most one stop lingers
    pending.stage = Stage::lingering;
    const Time timeout = std::chrono::milliseconds{options_.timing.timeout_ms};
    pending.deadline = now + (failed ? timeout : Time{options_.stop_linger});
  } else {
    pending_.remove(pending);
  }
}

bool CommandsUnderWay::expire(Time now) {
  bool stop = false;
  for (Pending& pending : pending_.under_way()) {
    if (now < pending.deadline) continue;
    if (pending.kind == CommandKind::stop && pending.is_out()) stop = true;
    finish(pending, Outcome::timed_out, Refusal::none, now);
  }
  return stop;
}

void CommandsUnderWay::refuse_held_back(Time now) {
  if (arming_.may_drive()) return;
  for (Pending& pending : pending_.under_way()) {
    if (pending.ticket > arming_.first()) return;
    if (pending.stage == Stage::queued && is_held_back(pending.kind)) {
      finish(pending, Outcome::not_armed, Refusal::none, now);
    }
  }
}

void CommandsUnderWay::cancel(Ticket ticket, Time now) {
  for (Pending& pending : pending_.under_way()) {
    if (pending.ticket != ticket || pending.kind == CommandKind::stop) continue;
    finish(pending, Outcome::cancelled, Refusal::none, now);
  }
}

void CommandsUnderWay::end_all_but_stops(Outcome outcome, Time now) {
  for (Pending& pending : pending_.under_way()) {
    if (pending.kind != CommandKind::stop) finish(pending, outcome, Refusal::none, now);
  }
}

void CommandsUnderWay::give_up(Time now) {
  for (Pending& pending : pending_.under_way()) {
    if (pending.kind == CommandKind::stop || is_question(pending.kind)) continue;
    finish(pending, Outcome::cancelled, Refusal::none, now);
  }
}

void CommandsUnderWay::forget_stop() {
  for (Pending& pending : pending_.under_way()) {
    if (pending.stage == Stage::lingering) pending_.remove(pending);
  }
}

void CommandsUnderWay::end_all(Time now) {
  for (Pending& pending : pending_.under_way()) {
    finish(pending, Outcome::closed, Refusal::none, now);
  }
}

void CommandsUnderWay::remove_step() {
  step_end_.reset();
  for (Pending& pending : pending_.under_way()) {
    if (pending.is_step) pending_.remove(pending);
  }
}

bool CommandsUnderWay::is_stopping() {
  for (const Pending& pending : pending_.under_way()) {
    if (pending.kind == CommandKind::stop && pending.is_out()) return true;
  }
  return false;
}

bool CommandsUnderWay::delays_arming() {
  for (const Pending& pending : pending_.under_way()) {
    const bool earlier = pending.kind == CommandKind::clear && pending.ticket < arming_.first();
    if (pending.is_step || earlier) return true;
  }
  return is_stopping();
}

}  // namespace r4
