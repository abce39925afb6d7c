// SPDX-License-Identifier: GPL-3.0-or-later
// Groups of commands: as one datagram, or one command after the other where the board knows no groups.
#include <array>

#include "../../protocol/messages/command_field.hpp"
#include "../commands/command_help.hpp"
#include "limits.hpp"
#include "session.hpp"

namespace r4 {

Ticket Session::send(const Setpoints& group, Time timeout, Time now) {
  require_any(group);
  require_control(board_role_, group);
  if (group.size() == 1) return send(group[0], timeout, now);
  Pending* const pending = allocate(group[0], timeout, now);
  if (pending == nullptr) return 0;
  pending->group = group;
  ++collector_.counts.commands;
  const Ticket ticket = pending->ticket;
  send_queued(now);
  return ticket;
}

PostResult Session::post(const Setpoints& group, Time now) {
  require_any(group);
  require_control(board_role_, group);
  if (group.size() == 1) return post(group[0], now);
  send_queued(now);  // what was asked for earlier goes first
  if (!in_control(now)) return PostResult::no_link;
  if (!may_drive()) {
    ++collector_.counts.refused;
    return PostResult::not_armed;
  }
  if (group_is_ahead()) return PostResult::queue_full;
  if (!knows_groups(now)) return PostResult::no_link;
  std::array<char, max_datagram> buffer;
  DatagramWriter writer(buffer.data(), buffer.size());
  for (std::size_t i = 0; i < group.size(); ++i) write_command(writer, group[i]);
  stamp(writer, group[0].kind, link_.take_pnum(), to_ms(now));
  const PathSet over =
      send_over(writer, {group[0].kind, link_.last_pnum(), all_paths}, Priority::normal, now);
  posted_.add(link_.last_pnum(), group);
  return note_post(group[0].kind, over);
}

// Is it known whether the board executes groups? If not, it is asked.
bool Session::knows_groups(Time now) {
  if (groups_.ask(selection_.answers(), now)) {
    transmit_now(Command::identify(), to_ms(now), Priority::normal, now);
    question_.asked(link_.last_pnum(), now);
  }
  return groups_.state() != GroupSupport::State::unknown;
}

// One datagram, or many? False: that is not known yet, and the group waits.
bool Session::choose_form(Pending& pending, Time now) {
  if (pending.step != 0) return true;
  if (!knows_groups(now)) {
    group_waits_ = true;
    return false;
  }
  if (groups_.state() == GroupSupport::State::apart) pending.step = 1;
  return true;
}

// The fields of what is to be sent of it now.
void Session::write_group(Pending& pending) {
  DatagramWriter writer(pending.bytes.data(), pending.bytes.size());
  if (pending.step != 0) {
    pending.command = pending.group[pending.step - 1U];
    write_command(writer, pending.command);
  } else {
    for (std::size_t i = 0; i < pending.group.size(); ++i) write_command(writer, pending.group[i]);
  }
  pending.size = writer.size();
}

// A command of a group was executed. If more follow, the next is to be sent, by a number of its own.
bool Session::go_on(Pending& pending) {
  if (!pending.has_more()) return false;
  ++pending.step;
  pending.stage = Stage::queued;
  return true;
}

// Does a group wait to be sent, or are commands of one left? What is asked for later must not overtake them.
bool Session::group_is_ahead() {
  if (group_waits_) return true;
  for (const Pending& pending : pending_.under_way()) {
    if (pending.has_more()) return true;
  }
  return false;
}

}  // namespace r4
