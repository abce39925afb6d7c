// SPDX-License-Identifier: GPL-3.0-or-later
// How the session comes to be armed, and what it refuses while it is not (arming.hpp).
#include "limits.hpp"
#include "session.hpp"

namespace r4 {

namespace {

constexpr int supply_relay = 1;

}  // namespace

// An arm() is a command that is never sent: it waits in its slot while its steps are.
Ticket Session::arm(Time timeout, Time now) {
  require_control(board_role_, "arm()");
  Pending* const pending = allocate(Command::relay(supply_relay, true), timeout, now);
  if (pending == nullptr) return 0;
  pending->role = Pending::Role::arm;
  name_cause(*pending);
  return pending->ticket;
}

bool Session::may_drive() const { return options_.arming == Arming::off || arming_.armed(); }

bool Session::is_held_back(CommandKind kind) const { return drives_output(kind) && !may_drive(); }

void Session::disarm(DisarmCause cause) {
  arming_.disarm(cause);
  tell_arming();
}

// As a session begins.
void Session::disarm_anew() {
  arming_ = ArmingMachine();
  tell_arming();
}

void Session::tell_arming() {
  if (told_cause_ == arming_.cause()) return;
  told_cause_ = arming_.cause();
  effects_.tell(ArmingChanged{told_cause_});
}

// What the board's newest datagram says of it, and what the link does. What the board said before
// it obeyed us may have been on its way since before the session.
void Session::look_at_arming(Time now) {
  if (!link_up()) arming_.on_outage();
  if (in_control(now)) arming_.on_heard(link_.reason());
  if (link_.state() == HostLinkState::safe) arming_.on_reason(link_.reason());
  tell_arming();
}

// A state that the board sent while nothing kept its outputs off.
void Session::look_at_supply() {
  if (!link_up() || state_.safe != SafeReason::none) return;
  if (!state_.present.has(StateField::relays)) return;
  arming_.on_supply(supply_closed());
}

bool Session::supply_closed() const { return (state_.relays & 1U << (supply_relay - 1)) != 0; }

// Goes on with arm() where it can.
void Session::advance_arming(Time now) {
  bool wanted = false;
  bool must_wait = !in_control(now);
  for (const Pending& pending : pending_.under_way()) {
    wanted = wanted || pending.role == Pending::Role::arm;
    // For a step of its own, and for a stop or an E:CLEAR that was asked for.
    must_wait = must_wait || pending.role == Pending::Role::arm_step ||
                pending.kind == CommandKind::stop || pending.kind == CommandKind::clear;
  }
  if (!wanted) {
    if (arming_.under_way()) give_up_arming();
    return;
  }
  if (!arming_.under_way()) arming_.begin();
  if (must_wait) return;
  if (arming_.armed()) {
    end_arming(Outcome::confirmed, Refusal::none, now);
    return;
  }
  switch (arming_.next(link_.reason())) {
    case ArmingMachine::Step::wait:
      break;
    case ArmingMachine::Step::clear:
      send_arming_step(Command::clear(), now);
      break;
    case ArmingMachine::Step::close:
      send_arming_step(Command::relay(supply_relay, true), now);
      break;
    case ArmingMachine::Step::fail:
      end_arming(Outcome::not_armed, Refusal::none, now);
      break;
  }
}

// arm() waits for it, and has a deadline of its own.
void Session::send_arming_step(const Command& command, Time now) {
  Pending* const pending = allocate(command, std::chrono::hours{24}, now);
  if (pending == nullptr) {  // all slots are taken
    end_arming(Outcome::full, Refusal::none, now);
    return;
  }
  pending->role = Pending::Role::arm_step;
  transmit(*pending, now);
}

void Session::on_arming_step(CommandKind kind, Outcome outcome, Refusal code, Time now) {
  if (outcome != Outcome::confirmed) {
    if (outcome == Outcome::refused) end_arming(outcome, code, now);
    return;  // cancelled: arm() is, too
  }
  if (kind != CommandKind::relay) return;  // the next step is chosen by what the board says now
  const bool open = state_.present.has(StateField::relays) && !supply_closed();
  if (link_.reason() != SafeReason::none || open) return;
  arming_.on_closed();
  tell_arming();
}

// Every arm() that waits ends.
void Session::end_arming(Outcome outcome, Refusal code, Time now) {
  give_up_arming();
  for (Pending& pending : pending_.under_way()) {
    if (pending.role == Pending::Role::arm) finish(pending, outcome, code, now);
  }
}

void Session::give_up_arming() {
  arming_.give_up();
  for (Pending& pending : pending_.under_way()) {
    if (pending.role == Pending::Role::arm_step) pending_.remove(pending);
  }
}

// Output commands that wait to be sent end here, but those that wait for an arm() before them.
void Session::refuse_held_back(Time now) {
  if (may_drive()) return;
  for (Pending& pending : pending_.under_way()) {
    if (pending.role == Pending::Role::arm) return;
    if (pending.stage == Stage::queued && is_held_back(pending.kind)) {
      finish(pending, Outcome::not_armed, Refusal::none, now);
    }
  }
}

const char* to_text(PostResult result) {
  switch (result.value()) {
    case PostResult::sent:
      return "sent";
    case PostResult::not_armed:
      return "not armed";
    case PostResult::no_link:
      return "no link";
    case PostResult::queue_full:
      return "queue full";
  }
  return "unknown";
}

// The board refused a command that was posted.
void Session::on_post_refused(const Nack& nack) {
  const PostedCommands::Entry* const posted = posted_.take(nack.pnum);
  if (posted == nullptr || nack.code == Refusal::duplicate) return;
  ++collector_.counts.refused;
  RefusedPost refused{posted->command, nack.code, PostResult::sent};
  if (posted->is_group) {
    const Setpoints& group = posted_.group_of(*posted);
    refused.group = static_cast<std::uint8_t>(group.size());
    if (nack.at <= group.size()) refused.at = nack.at;
    if (refused.at != 0) refused.command = group[refused.at - 1U];
  }
  effects_.tell(PostRefused{refused});
}

}  // namespace r4
