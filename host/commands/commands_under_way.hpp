// SPDX-License-Identifier: GPL-3.0-or-later
// The commands of a session from the call to the end. Commands are sent when the session has
// control, and repeated until the board's answer or state proves the end. Without I/O.
//     queued --control--> sent --CMD == PNum in the board's state--> confirmed
//                          |  ^                  N:…,<code>  ------> refused
//                          +--+ the same bytes   deadline    ------> timed out
//                         every 50 ms
//
// A retry has the bytes and the packet number of the original, and a new signature if there is a
// key. So the board executes the command only once. When CMD has passed a command, the retry's
// answer decides: DUPLICATE proves that the command was executed, STALE that it was not. Only a
// refusal with a session that began before the command proves that the command was not executed.
// The board forgets executed commands over an outage. With a key or several paths, AUTH proves only
// that one duplicate was refused. Without CMD (the paper's release), the value in a state is the
// proof.
//
// If the board executes groups (../link/group_support.hpp), a group is one datagram and one pending
// command. Otherwise its commands are sent one after the other, and later commands wait.
//
// E:STOP does not wait for the link. E:STOP is repeated every 20 ms until a heartbeat reports the
// reason `stop` and the number of this stop. Then it is repeated for stop_linger, because an
// E:CLEAR of another program may arrive. A stop that is not confirmed before its deadline has
// failed: the session ends (Session::on_failed_stop()), and the stop is repeated for the link's
// timeout, because the board may obey the ended session for its own timeout. E:CLEAR names the
// cause that was known at the call, and is given up when the board reports a newer cause.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>

#include "../../protocol/link/host_link.hpp"
#include "../../protocol/messages/message.hpp"
#include "../arming/arm_requests.hpp"
#include "../link/effects.hpp"
#include "../link/heard_board.hpp"
#include "../link/link_keeper.hpp"
#include "../link/outbox.hpp"
#include "../measurement/time.hpp"
#include "pending_commands.hpp"
#include "r4link/command.hpp"
#include "r4link/options.hpp"
#include "r4link/setpoints.hpp"

namespace r4 {

class CommandsUnderWay {
 public:
  static constexpr std::size_t max_pending = 64;
  static constexpr std::size_t max_stops = 16;

  // All references must outlive this.
  CommandsUnderWay(const SessionOptions& options, HostLink& link, LinkKeeper& keeper,
                   Outbox& outbox, HeardBoard& board, const ArmRequests& arming, Effects& effects,
                   Statistics& counts);

  // --- calls of the program. If there is no room, each call returns 0.

  // A stop is sent even without room. The caller first ends all other commands under way.
  Ticket send(const Command& command, Time timeout, Time now);
  Ticket send(const Setpoints& group, Time timeout, Time now);
  Ticket leave(Time timeout, Time now);
  Ticket take_ticket() { return next_ticket_++; }
  void cancel(Ticket ticket, Time now);
  // End every command except stops. give_up() does not end questions either.
  void end_all_but_stops(Outcome outcome, Time now);
  void give_up(Time now);
  void end_all(Time now);
  void forget_stop();

  // --- a step of arm(). At most one is under way.

  bool send_step(const Command& command, Time now);
  void remove_step();
  struct StepEnd {
    CommandKind kind;
    CommandResult result;
  };
  std::optional<StepEnd> take_step_end() { return std::exchange(step_end_, {}); }
  // True if arm() has to wait for a step, a stop, or an earlier E:CLEAR.
  bool delays_arming();

  // True if a stop is under way, neither confirmed nor failed.
  bool is_stopping();
  // True if a stop failed.
  bool expire(Time now);
  void send_queued(Time now);
  // Ends held back output commands that do not wait for an arm().
  void refuse_held_back(Time now);
  void repeat(Time now);
  Time next();

  void on_state(Time now);
  void on_heartbeat(const SafeReport& report, std::optional<std::uint32_t> t_ms, Time now);
  void on_stop(const SafeReport& report, Time now);
  void on_identity(const Identity& identity, Time now);
  // `proof`: the command was not executed. `others`: other paths carry duplicates of the command.
  void on_refusal(const Nack& nack, bool proof, bool others, Time now);
  // True if the command with this number is a setting that the board accepts only over a cable.
  bool is_cable_only(std::uint32_t pnum);

  // True if a group or a part of a group waits: later commands must not overtake it.
  bool is_group_ahead();
  // True if the board has reported whether it executes groups. Otherwise Q:ID is sent.
  bool knows_groups(Time now);
  // The newest cause that only E:CLEAR ends; 0: none; unnamed_cause before the first heartbeat.
  std::int32_t cause() const { return cause_; }
  bool is_held_back(CommandKind kind) const { return drives_output(kind) && !arming_.may_drive(); }

 private:
  using Pending = PendingCommand;
  using Stage = PendingCommand::Stage;

  Pending* allocate(const Command& command, Time timeout, Time now);
  Ticket queue(Pending* pending, Time now);
  Ticket send_at_once(const Command& command, Time timeout, Time now);
  Ticket stop(Time timeout, Time now);
  void transmit(Pending& pending, Time now);
  void finish(Pending& pending, Outcome outcome, Refusal code, Time now);
  bool name_cause(Pending& pending) const;
  bool choose_form(Pending& pending, Time now);
  static void write_group(Pending& pending);
  bool is_after_farewell(std::uint32_t t_ms) const;

  const SessionOptions& options_;
  HostLink& link_;
  LinkKeeper& keeper_;
  Outbox& outbox_;
  HeardBoard& board_;
  const ArmRequests& arming_;
  Effects& effects_;
  Statistics& counts_;
  PendingCommands pending_;
  Ticket next_ticket_ = 1;
  std::int32_t cause_ = Command::unnamed_cause;
  bool group_waits_ = false;  // a group waits for the answer to Q:ID
  std::optional<StepEnd> step_end_;
  // The time of the farewell, and the newest T of a state before it.
  struct Farewell {
    Time at{0};
    std::optional<std::uint32_t> state_ms;
  } farewell_;
};

}  // namespace r4
