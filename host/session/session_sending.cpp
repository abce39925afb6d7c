// SPDX-License-Identifier: GPL-3.0-or-later
// What the session sends, and how a command of it ends.
#include <algorithm>
#include <array>
#include <bit>

#include "../../protocol/messages/command_field.hpp"
#include "../commands/command_help.hpp"
#include "limits.hpp"
#include "session.hpp"

namespace r4 {

namespace {

// Those that end what the board does: repeated soon, and sent while the heartbeats are held.
bool is_urgent(CommandKind kind) { return kind == CommandKind::stop || kind == CommandKind::leave; }

}  // namespace

// A command of the session needs no T. Heartbeats and leases echo by it.
void Session::stamp(DatagramWriter& writer, CommandKind kind, std::uint32_t pnum,
                    std::uint32_t t_ms) const {
  const bool echoes = kind == CommandKind::heartbeat || kind == CommandKind::watch;
  writer.session(session_id());
  echoes || watches() ? writer.stamp(pnum, t_ms) : writer.packet(pnum);
}

// A datagram of which no copy is kept.
PathSet Session::transmit_now(const Command& command, std::uint32_t t_ms, Priority priority,
                              Time now, PathSet paths) {
  std::array<char, max_datagram> buffer;
  DatagramWriter writer(buffer.data(), buffer.size());
  write_command(writer, command);
  stamp(writer, command.kind, link_.take_pnum(), t_ms);
  return send_over(writer, {command.kind, link_.last_pnum(), paths}, priority, now);
}

// A stop goes to every path. Anything else goes to the paths that lead to the session's board, if that
// board has our key. Each path has a signature of its own, which proves that path (docs/protocol.md, "Paths").
PathSet Session::send_over(DatagramWriter& writer, Way way, Priority priority, Time now) {
  const bool stop = way.kind == CommandKind::stop;
  if (key_.refuses_board() && !stop) return 0;
  const PathSet to = stop ? way.paths : static_cast<PathSet>(way.paths & paths_.speaking());
  PathSet over = 0;
  for (std::size_t i = 0; i < paths_.count(); ++i) {
    if ((to & path_bit(i)) == 0) continue;
    transmit_over(i, writer, way, priority, now);
    over |= path_bit(i);
  }
  return over;
}

void Session::transmit_over(std::size_t path, DatagramWriter& writer, Way way, Priority priority,
                            Time now) {
  const std::size_t size = writer.size();
  if (!watches()) key_.sign(writer, now);  // a watcher's datagrams need no signature
  const Text bytes = writer.finish();
  if (way.kind == CommandKind::identify) paths_.asked(path, way.pnum, now);
  effects_.send(path, priority, way.kind, way.pnum, {bytes.data(), bytes.size()});
  writer.truncate(size);
}

// A heartbeat or a post has come somewhere if one of its paths has taken it.
void Session::on_sent(const Sending& sending, SendResult result, Time now) {
  for (Underway* const each : {&heartbeat_, &post_}) {
    if (each->open == 0 || each->pnum != sending.pnum) continue;
    --each->open;
    const bool first = result == SendResult::sent && each->best != SendResult::sent;
    if (first || each->best == SendResult::down) each->best = result;
    if (each != &heartbeat_) continue;
    if (first) {
      ++collector_.counts.heartbeats;
      key_.on_heartbeat_sent();
    }
    if (each->open == 0 && each->best != SendResult::sent) link_.heartbeat_not_sent(to_ms(now));
  }
  if (result != SendResult::busy) return;
  paths_.on_busy(sending.path, {}, now);
  if (paths_.all_busy(now)) role_.on_busy_until(paths_.all_busy_until(now));
  refresh_status(now);
}

// One question to all that are to be asked who their board is.
void Session::ask_paths(Time now) {
  if (const PathSet due = paths_.to_ask(now); due != 0) {
    std::array<char, max_datagram> buffer;
    DatagramWriter writer(buffer.data(), buffer.size());
    write_command(writer, Command::identify());
    stamp(writer, CommandKind::identify, link_.take_pnum(), to_ms(now));
    for (std::size_t i = 0; i < paths_.count(); ++i) {
      if ((due & path_bit(i)) == 0) continue;
      transmit_over(i, writer, {CommandKind::identify, link_.last_pnum(), all_paths},
                    Priority::normal, now);
    }
  }
  if (paths_.poll(now)) link_.on_transport(true);  // the first heartbeat goes out at once
}

Session::Pending* Session::allocate(const Command& command, Time timeout, Time now) {
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
    repetition_.cancel();  // who clears a stop repeats it no more
  }
  return slot;
}

// Gives an E:CLEAR or an arm() the number of the cause that is known now, if it has none yet. False:
// nothing of the board has been heard.
bool Session::name_cause(Pending& pending) const {
  if (pending.cause == Command::unnamed_cause) pending.cause = cause_;
  if (pending.cause == Command::unnamed_cause) return false;
  if (pending.stage == Stage::queued && pending.kind == CommandKind::clear) {
    DatagramWriter writer(pending.bytes.data(), pending.bytes.size());
    write_command(writer, Command::clear(pending.cause));
    pending.size = writer.size();
  }
  return true;
}

Ticket Session::send(const Command& command, Time timeout, Time now) {
  require_valid(command);
  require_control(board_role_, command);
  Pending* pending = allocate(with_needed_fields(command), timeout, now);
  if (pending == nullptr) return 0;
  ++collector_.counts.commands;
  const Ticket ticket = pending->ticket;
  send_queued(now);
  return ticket;
}

PostResult Session::post(const Command& command, Time now) {
  require_valid(command);
  require_control(board_role_, command);
  send_queued(now);  // what was asked for earlier goes first
  if (!in_control(now)) return PostResult::no_link;
  if (is_held_back(command.kind)) {
    ++collector_.counts.refused;
    return PostResult::not_armed;
  }
  if (group_is_ahead()) return PostResult::queue_full;
  const bool unnamed =
      command.kind == CommandKind::clear && command.value == Command::unnamed_cause;
  const PathSet over =
      transmit_now(unnamed ? Command::clear(cause_) : command, to_ms(now), Priority::normal, now);
  posted_.add(link_.last_pnum(), command);
  return note_post(command.kind, over);
}

PostResult Session::note_post(CommandKind kind, PathSet over) {
  post_ = {kind, link_.last_pnum(), std::popcount(over), SendResult::down};
  return over != 0 ? PostResult::sent : posted();
}

PostResult Session::posted() {
  if (post_.best != SendResult::sent) {
    posted_.take(post_.pnum);
    return post_.best == SendResult::full ? PostResult::queue_full : PostResult::no_link;
  }
  ++collector_.counts.commands;
  if (post_.kind == CommandKind::clear)
    repetition_.cancel();  // who clears a stop repeats it no more
  return PostResult::sent;
}

Ticket Session::stop(Time timeout, Time now) {
  repetition_.cancel();  // this one goes on from here
  ++collector_.counts.commands;
  give_up_arming();
  disarm(DisarmCause::stop);
  Ticket ticket = 0;
  if (Pending* pending = allocate(Command::stop(), timeout, now)) {
    ticket = pending->ticket;
    transmit(*pending, now);
  } else {
    transmit_now(Command::stop(), to_ms(now), Priority::stop, now);
  }
  // Nothing that was asked for before a stop may follow it.
  for (Pending& pending : pending_.under_way()) {
    if (pending.kind != CommandKind::stop) {
      finish(pending, Outcome::cancelled, Refusal::none, now);
    }
  }
  return ticket;
}

Ticket Session::identify(Time timeout, Time now) {
  Pending* pending = allocate(Command::identify(), timeout, now);
  if (pending == nullptr) return 0;
  const Ticket ticket = pending->ticket;
  transmit(*pending, now);
  return ticket;
}

// Sends a pending command: the first time with a number of its own, then the same again.
void Session::transmit(Pending& pending, Time now) {
  const bool stop = pending.kind == CommandKind::stop;
  if (pending.stage == Stage::queued) {
    if (pending.is_group()) write_group(pending);
    pending.pnum = link_.take_pnum();
    // The command's field is there already.
    DatagramWriter writer(pending.bytes.data(), pending.bytes.size(), pending.size);
    stamp(writer, pending.kind, pending.pnum, to_ms(now));
    pending.size = writer.size();
    pending.stage = Stage::sent;
    if (pending.kind == CommandKind::identify) question_.asked(pending.pnum, now);
  } else {
    ++collector_.counts.retries;
  }
  pending.retry =
      now + (is_urgent(pending.kind) ? Time{options_.stop_retry} : Time{options_.command_retry});
  DatagramWriter writer(pending.bytes.data(), pending.bytes.size(), pending.size);
  send_over(writer, {pending.kind, pending.pnum, all_paths},
            stop ? Priority::stop : Priority::normal, now);
}

// In the order of send(): tickets rise.
void Session::send_queued(Time now) {
  group_waits_ = false;
  if (!in_control(now)) return;
  for (Pending& pending : pending_.under_way()) {
    if (pending.role == Pending::Role::arm) return;  // it comes first
    if (pending.stage == Stage::queued && !is_held_back(pending.kind) && now < pending.deadline) {
      if (pending.is_group() && !choose_form(pending, now)) return;
      transmit(pending, now);
    }
    if (pending.has_more()) return;
  }
}

void Session::retry_due(Time now) {
  const bool gated = link_.gated(to_ms(now));
  for (Pending& pending : pending_.under_way()) {
    if (!pending.is_out() || now < pending.retry) continue;
    if (gated && !is_urgent(pending.kind)) {
      pending.retry = now + options_.command_retry;
    } else {
      transmit(pending, now);
    }
  }
}

// A confirmed stop, a few times more.
void Session::repeat_stop(Time now) {
  const std::string_view stop = repetition_.due(options_.stop_retry, now);
  if (stop.empty()) return;
  ++collector_.counts.retries;
  std::array<char, max_datagram> buffer;
  std::copy(stop.begin(), stop.end(), buffer.begin());
  DatagramWriter writer(buffer.data(), buffer.size(), stop.size());
  send_over(writer, {CommandKind::stop, 0, all_paths}, Priority::stop, now);
}

void Session::finish(Pending& pending, Outcome outcome, Refusal code, Time now) {
  if (pending.role == Pending::Role::arm_step) {
    const CommandKind kind = pending.kind;
    pending_.remove(pending);
    on_arming_step(kind, outcome, code, now);
    return;
  }
  if (outcome == Outcome::confirmed && go_on(pending)) return;
  switch (outcome) {
    case Outcome::confirmed:
      ++collector_.counts.confirmed;
      break;
    case Outcome::refused:
    case Outcome::not_armed:
      ++collector_.counts.refused;
      break;
    case Outcome::timed_out:
      ++collector_.counts.timed_out;
      break;
    case Outcome::none:
    case Outcome::cancelled:
    case Outcome::closed:
    case Outcome::blocked:
    case Outcome::full:
      break;
  }
  const Ticket ticket = pending.ticket;
  CommandResult result{outcome, code, now - pending.started,
                       outcome == Outcome::not_armed ? arming_.cause() : DisarmCause::none};
  result.pnum = pending.pnum;
  if (outcome != Outcome::confirmed) {
    result.at = pending.step != 0 ? pending.step : pending.failed;
    if (pending.step != 0) result.executed = static_cast<std::uint8_t>(pending.step - 1);
  }
  pending_.remove(pending);
  effects_.tell(CommandEnded{ticket, result});
}

void Session::cancel(Ticket ticket, Time now) {
  for (Pending& pending : pending_.under_way()) {
    if (pending.ticket != ticket || pending.kind == CommandKind::stop) continue;
    finish(pending, Outcome::cancelled, Refusal::none, now);
    advance_arming(now);
  }
}

// The answer that tells whether the board knows farewells may have been lost. A board that confirms
// commands refuses what it does not know.
bool Session::may_say_farewell() const {
  return link_up() && !watches() && knows_leave_.value_or(state_.present.has(StateField::cmd));
}

Ticket Session::release_control(Time timeout, Time now) {
  end_all_but_stops(Outcome::cancelled, now);
  return leave(timeout, now);
}

Ticket Session::leave(Time timeout, Time now) {
  end_all_but_stops(Outcome::closed, now);
  for (std::size_t i = 0; watches() && i < paths_.count(); ++i) {
    transmit_now(Command::watch(0), paths_.leases()[i].echo(), Priority::normal, now, path_bit(i));
  }
  disarm_anew();
  leaving_ = true;  // a heartbeat behind the farewell would take the board again
  left_at_ = now;
  if (state_.any()) left_ms_ = state_.t_ms;
  if (!may_say_farewell()) return 0;
  Pending* pending = allocate(Command::leave(), timeout, now);
  if (pending == nullptr) return 0;
  ++collector_.counts.commands;
  transmit(*pending, now);
  return pending->ticket;
}

void Session::end_all_but_stops(Outcome outcome, Time now) {
  for (Pending& pending : pending_.under_way()) {
    if (pending.kind != CommandKind::stop) finish(pending, outcome, Refusal::none, now);
  }
}

void Session::end_all(Time now) {
  for (Pending& pending : pending_.under_way()) {
    finish(pending, Outcome::closed, Refusal::none, now);
  }
}

}  // namespace r4
