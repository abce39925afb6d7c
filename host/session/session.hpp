// SPDX-License-Identifier: GPL-3.0-or-later
// The host's side of one board, without I/O: datagrams and time in, datagrams and events out.
//
// It keeps the link alive (protocol/link/host_link), takes control, chooses the state fields it needs,
// sends commands and finds out whether the board executed them:
//
//     queued --control--> sent --CMD == PNum in the board's state--> confirmed
//                          |  ^                  N:…,<code>  ------> refused
//                          +--+ the same bytes   deadline    ------> timed out
//                         every 50 ms
//
// It is put together from machines, each with its own diagram: what the board knows of us
// (host_role.hpp), the fields that it sends (field_selection.hpp), the commands under way
// (pending_commands.hpp), arming (arming.hpp), the key (host_key.hpp), the question who the board is
// (measurement/identity_question.hpp), the board's clock on ours (measurement/board_clock.hpp), the stop that
// lasts (stop_repetition.hpp) and, where the session only watches, its lease at the board (lease.hpp).
//
// Every datagram goes out on each of the paths (paths.hpp), written once and signed for each; what comes in is taken
// once, whichever path brings it first, and newest is what has the newest T. Leases alone are each path's own.
//
// A retry has the bytes and the packet number of the original (signed anew, where there is a key),
// so the board can execute it only once. When CMD has moved past a command, the retry's answer
// (DUPLICATE: executed, STALE: not) decides. A refusal proves that the command was not executed only
// if it names a session that began before the command was sent: over an outage the board forgets. A
// board without CMD (the paper's release) confirms by the value that its state shows.
//
// With a key (host_key.hpp) all is signed, a board without one is refused, and AUTH says only that one
// copy was not taken: another may have been executed.
//
// Commands that drive outputs are refused here while the session is not armed (arming.hpp).
//
// A group of them is one datagram, and one pending command, where the board executes groups
// (group_support.hpp).
//
// E:STOP does not wait for the link, overtakes everything, discards all commands that wait, and is
// repeated every 20 ms until a heartbeat of the board reports the reason `stop` and this stop's own
// number, and for a while longer, in case that somebody's E:CLEAR was on its way. E:CLEAR names the
// cause that was known when it was asked for; when the board tells of a newer one, it is given up.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "../../protocol/link/host_link.hpp"
#include "../../protocol/messages/message.hpp"
#include "../commands/group_support.hpp"
#include "../commands/pending_commands.hpp"
#include "../commands/posted_commands.hpp"
#include "../measurement/board_clock.hpp"
#include "../measurement/identity_question.hpp"
#include "../measurement/statistics.hpp"
#include "../measurement/time.hpp"
#include "../paths/paths.hpp"
#include "arming.hpp"
#include "effects.hpp"
#include "field_selection.hpp"
#include "host_key.hpp"
#include "host_role.hpp"
#include "r4link/carrier.hpp"
#include "r4link/command.hpp"
#include "r4link/error.hpp"
#include "r4link/link.hpp"
#include "r4link/options.hpp"
#include "stop_repetition.hpp"

namespace r4 {

class Session {
 public:
  // `random` gives 64 random bits at each call.
  // Throws Error{usage} if options.fields are no state fields.
  explicit Session(
      SessionOptions options, BoardRole role = BoardRole::control, std::size_t paths = 1,
      std::function<std::uint64_t()> random = [] { return random_bits(); });
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  static constexpr std::size_t most_paths = 4;

  // What is to be done after each call that takes a time. Each sending has to be told its result.
  Effects& effects() { return effects_; }
  void on_sent(const Sending& sending, SendResult result, Time now);

  // A datagram has come over that path. poll() is needed then.
  void receive(std::size_t path, std::string_view bytes, Time now);
  // Does what is due.
  void poll(Time now);
  // When poll() is needed next, at the latest.
  Time next_poll(Time now);
  // What all transports have.
  void on_trouble(TransportTrouble trouble) { trouble_ = trouble; }
  // The transport of a path has come, or gone; poll() is needed now. Before it has come it is gone.
  // `can_ask`: false where who watches may send no question (a bus).
  void on_transport(std::size_t path, bool up, Time now, bool can_ask = true);
  // This computer slept for longer than the board waits for its host, while `now` stood still.
  // Another session begins: it is disarmed, and every command under way but a stop is cancelled.
  // BoardRestarted tells so. poll() is needed now.
  void on_sleep(Time now);

  // Sends a command and finds out what became of it: CommandEnded tells, at the latest at `timeout` from
  // now. Throws Error{usage} for a command outside its ranges; returns 0 when 64 are under way
  // already.
  Ticket send(const Command& command, Time timeout, Time now);
  // The same of several that the board executes together or not at all; a board that knows no groups is
  // sent one after the other, each when the one before is confirmed, and what is asked for later waits for
  // the last. Throws Error{usage} for none.
  Ticket send(const Setpoints& group, Time timeout, Time now);
  // Sends a command once and does not wait for it: PostRefused tells if the board refuses it. `sent`: it is among
  // the effects, and posted() tells its result when they are done.
  PostResult post(const Command& command, Time now);
  // no_link also as long as it is not known whether the board executes groups.
  PostResult post(const Setpoints& group, Time now);
  // Does the board execute no groups? Then their commands are posted one after the other.
  bool posts_apart() const { return groups_.state() == GroupSupport::State::apart; }
  PostResult posted();
  // Clears what made the outputs safe, where that can be cleared, and closes relay 1, the motor supply:
  // confirmed when the board's state shows it. Output commands that are sent behind it wait for it.
  // Returns 0 when 64 commands are under way already.
  Ticket arm(Time timeout, Time now);
  // E:STOP. Confirmed when the board tells that it has obeyed this very
  // stop. Returns 0, with the stop sent all the same, when 16 stops are under way already.
  Ticket stop(Time timeout, Time now);
  // Asks who the board is; BoardIdentified follows. Confirmed by the answer.
  Ticket identify(Time timeout, Time now);
  // Gives a command up, though it may have been executed: CommandEnded tells so. A stop
  // goes on.
  void cancel(Ticket ticket, Time now);
  // Ends every command under way but stops, the heartbeats too, and says farewell: the board's outputs are
  // safe at once, and another host need not wait for the timeout. Confirmed when the board tells so.
  // Returns 0 where there is nobody to tell, or the board knows no farewells. Nothing but stops is sent from
  // then on.
  Ticket leave(Time timeout, Time now);
  bool leaving() const { return leaving_; }
  // The same, but the commands end as cancelled: to watch from then on, change_role() when the
  // farewell has ended.
  Ticket release_control(Time timeout, Time now);
  // From now on it controls, or only watches. Disarmed; with a new session id. Every command under
  // way but stops is cancelled. on_transport() is needed then for each path that is up.
  void change_role(BoardRole role, Time now);
  // Ends every command under way: the board is closed.
  void end_all(Time now);

  // The application watchdog: without feed() for `period` the heartbeats stop, and the board goes
  // safe; commands are held back, too, for nobody looks after what they do. 0 turns it off.
  void watchdog(std::chrono::milliseconds period, Time now);
  void feed(Time now);
  // Stops heartbeats and commands likewise, until it is called with false.
  void hold(bool held, Time now);

  BoardRole board_role() const { return board_role_; }
  const LinkStatus& link() const { return status_; }
  // The link is up, the board has executed a command of ours, and the watchdog has not expired:
  // commands go out at once.
  bool in_control(Time now) const;
  // Why the session is not armed; none if it is.
  DisarmCause disarmed_by() const { return arming_.cause(); }
  // Are output commands sent?
  bool may_drive() const;
  // Has the board told which cause an E:CLEAR would have to name? One that is asked for sooner names the
  // first that is told.
  bool knows_cause() const { return cause_ != Command::unnamed_cause; }
  const ReceivedState& state() const { return state_; }
  // The fields that are asked for, as in F; empty: the board's own choice is left alone.
  const std::string& fields() const { return selection_.fields(); }
  Statistics statistics(Time now) const;
  // Of the board's datagrams.
  const PacketCounters& packets() const { return paths_.counters(); }
  // All of it but its name.
  PathStatus path(std::size_t index, Time now) const { return paths_.report(index, now); }

  static constexpr std::size_t max_pending = 64;
  static constexpr std::size_t max_stops = 16;
  static std::uint64_t random_bits();

 private:
  using Pending = PendingCommand;
  using Stage = PendingCommand::Stage;

  Pending* allocate(const Command& command, Time timeout, Time now);
  void transmit(Pending& pending, Time now);
  void send_queued(Time now);
  void retry_due(Time now);
  void finish(Pending& pending, Outcome outcome, Refusal code, Time now);
  // To which paths it goes.
  PathSet transmit_now(const Command& command, std::uint32_t t_ms, Priority priority, Time now,
                       PathSet paths = all_paths);
  PostResult note_post(CommandKind kind, PathSet over);
  // session_groups.cpp
  bool knows_groups(Time now);
  bool choose_form(Pending& pending, Time now);
  static void write_group(Pending& pending);
  bool go_on(Pending& pending);
  bool group_is_ahead();
  // What goes out: of which kind, by which number, and to which paths.
  struct Way {
    CommandKind kind;
    std::uint32_t pnum;
    PathSet paths;
  };
  static constexpr PathSet all_paths = 0xFF;
  PathSet send_over(DatagramWriter& writer, Way way, Priority priority, Time now);
  void transmit_over(std::size_t path, DatagramWriter& writer, Way way, Priority priority,
                     Time now);
  SessionId session_id() const { return watches() ? no_session : link_.session(); }
  void stamp(DatagramWriter& writer, CommandKind kind, std::uint32_t pnum,
             std::uint32_t t_ms) const;
  void ask_paths(Time now);
  bool others_speak(std::size_t path) const { return (paths_.speaking() & ~path_bit(path)) != 0; }
  void on_restarted(Time now);
  void forget_board(Time now);
  void note_own_command(Time now);

  bool link_up() const;
  void on_heartbeat_datagram(std::size_t path, const Datagram& datagram, Time now);
  void on_state_datagram(std::size_t path, const Datagram& datagram, Time now);
  void on_identity_datagram(std::size_t path, const Datagram& datagram, Time now);
  void on_nack_datagram(std::size_t path, const Datagram& datagram, Time now);
  bool counts(const Identity& identity) const;
  bool notice_restart(Time now);
  void begin_session();
  void give_up_commands(Time now);
  void end_all_but_stops(Outcome outcome, Time now);
  bool is_proof(const Nack& nack) const;
  bool is_cable_only(std::uint32_t pnum);
  void confirm_from_state(Time now);
  bool is_held_back(CommandKind kind) const;
  void disarm(DisarmCause cause);
  void disarm_anew();
  void tell_arming();
  void look_at_arming(Time now);
  void look_at_supply();
  bool supply_closed() const;
  void advance_arming(Time now);
  void send_arming_step(const Command& command, Time now);
  void on_arming_step(CommandKind kind, Outcome outcome, Refusal code, Time now);
  void end_arming(Outcome outcome, Refusal code, Time now);
  void give_up_arming();
  void refuse_held_back(Time now);
  void on_post_refused(const Nack& nack);
  void confirm_stop(const SafeReport& report, Time now);
  bool may_say_farewell() const;
  void confirm_leave(const SafeReport& report, std::uint32_t t_ms, Time now);
  bool is_behind_leave(std::uint32_t t_ms) const;
  void on_causes(std::int32_t newest, Time now);
  bool name_cause(Pending& pending) const;
  void repeat_stop(Time now);
  bool watches() const { return board_role_ == BoardRole::watch; }
  bool hears_board() const;
  Time question_interval() const;
  void send_heartbeat(Time now);
  void send_lease(Time now);
  void on_lease_refused(std::size_t path, const Nack& nack, const Datagram& datagram, Time now);
  void select_fields(Time now);
  Command with_needed_fields(const Command& command);
  void refresh_status(Time now);

  Effects effects_;
  SessionOptions options_;
  BoardRole board_role_;
  std::function<std::uint64_t()> random_;
  HostLink link_;
  HostKey key_;
  HostRoleMachine role_;
  FieldSelection selection_;
  IdentityQuestion question_;
  BoardClock clock_;
  Paths paths_;
  StopRepetition repetition_;
  LinkStatus status_;
  TransportTrouble trouble_ = TransportTrouble::none;
  ReceivedState state_;
  std::uint32_t restarts_ = 0;       // of the board, those that were told
  std::optional<bool> knows_leave_;  // does the board?
  bool held_ = false;                // hold()
  bool leaving_ = false;
  Time left_at_{0};
  std::optional<std::uint32_t> left_ms_;  // the T of the newest state by then
  bool transport_down_ = false;
  bool group_waits_ = false;  // for the answer to Q:ID
  StatisticsCollector collector_;
  ArmingMachine arming_;
  DisarmCause told_cause_ = DisarmCause::not_yet;
  PendingCommands pending_;
  PostedCommands posted_;
  GroupSupport groups_;
  // A heartbeat, and a post: over how many paths they have yet to go, and what became of them so far.
  struct Underway {
    CommandKind kind = CommandKind::heartbeat;
    std::uint32_t pnum = 0;
    int open = 0;
    SendResult best = SendResult::down;
  };
  Underway heartbeat_, post_;
  Ticket next_ticket_ = 1;
  // As the newest heartbeat told it; unnamed_cause: none was heard.
  std::int32_t cause_ = Command::unnamed_cause;
  int questions_of_clock_ = 0;  // asked for its sake since the board began
};

}  // namespace r4
