// SPDX-License-Identifier: GPL-3.0-or-later
// The host's side of one board, without I/O: datagrams and time in, effects out
// (../link/effects.hpp). Each datagram is written once and signed for each path (outbox.hpp).
//
//   datagram --> Paths --> HostLink, HeardBoard --> LinkKeeper --> ArmRequests --> CommandsUnderWay
//                admits    the board's state        control        arming          ends of
//                                                                                  commands
//
// Session owns these parts. receive() and poll() show their order.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <type_traits>

#include "../../protocol/link/host_link.hpp"
#include "../../protocol/messages/message.hpp"
#include "../arming/arm_requests.hpp"
#include "../commands/commands_under_way.hpp"
#include "../commands/posts.hpp"
#include "../link/command_ends.hpp"
#include "../link/effects.hpp"
#include "../link/heard_board.hpp"
#include "../link/host_key.hpp"
#include "../link/link_keeper.hpp"
#include "../link/outbox.hpp"
#include "../measurement/statistics.hpp"
#include "../measurement/time.hpp"
#include "../paths/paths.hpp"
#include "r4link/carrier.hpp"
#include "r4link/command.hpp"
#include "r4link/link.hpp"
#include "r4link/options.hpp"

namespace r4 {

// More than 40 functions: most are its interface, and call one part each.
class Session {
 public:
  // `random`: 64 random bits a call; default: the system's. Throws Error{usage} for invalid fields.
  explicit Session(SessionOptions options, BoardRole role = BoardRole::control,
                   std::size_t paths = 1, std::function<std::uint64_t()> random = {});
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  static constexpr std::size_t most_paths = 4;
  static constexpr std::size_t max_pending = CommandsUnderWay::max_pending;
  static constexpr std::size_t max_stops = CommandsUnderWay::max_stops;

  // --- effects
  // After each call that takes a time, perform the sendings, then the reports. Give the result of
  // each sending to on_sent().
  Effects& effects() { return effects_; }
  void on_sent(const Sending& sending, SendResult result, Time now);

  // --- events. poll() is needed after each of these.

  void receive(std::size_t path, std::string_view bytes, Time now);
  // At first each path's transport is down. `can_ask`: false if a watcher may not ask (a bus).
  void on_transport(std::size_t path, bool up, Time now, bool can_ask = true);
  void on_trouble(TransportTrouble trouble) { keeper_.on_transport_trouble(trouble); }
  // This computer slept for longer than the board waits for its host, while `now` stood still. A
  // new, disarmed session begins, commands but stops are cancelled, and BoardRestarted reports it.
  void on_sleep(Time now);

  void poll(Time now);
  Time next_poll(Time now);

  // --- commands. CommandEnded reports the end, at most `timeout` after `now`.

  // Throws Error{usage} for a command outside its ranges. Returns 0 if 64 commands are under way.
  // Command::identify(): the answer confirms it, and BoardIdentified follows. Command::stop():
  // discards all other commands, and is confirmed when the board reports that it has obeyed this
  // very stop. If 16 stops are under way, it returns 0 but is sent.
  Ticket send(const Command& command, Time timeout, Time now);
  // Commands that the board executes together or not at all. If the board knows no groups, each
  // command is sent when its predecessor is confirmed. Throws Error{usage} for an empty group.
  Ticket send(const Setpoints& group, Time timeout, Time now);
  // Clears the cause of the safe state, if possible, and closes relay 1, the motor supply.
  // Confirmed by the board's state. Output commands that are sent after it wait for it.
  Ticket arm(Time timeout, Time now);
  // Ends heartbeats and all commands but stops, and sends the farewell: the outputs are safe at
  // once, and another host need not wait for the timeout. Confirmed by the board's report. Returns
  // 0 if no board hears it, or the board knows no farewells. Afterwards only stops are sent.
  Ticket leave(Time timeout, Time now);
  bool leaving() const { return keeper_.is_leaving(); }
  // The same, but the commands end as cancelled. After it, change_role() may let the session watch.
  Ticket release_control(Time timeout, Time now);
  // Makes the session control or watch. It is disarmed, has a new id, and every command under way
  // but stops is cancelled. on_transport() must follow for each path that is up.
  void change_role(BoardRole role, Time now);
  // Gives up a command, which the board may have executed. A stop continues.
  void cancel(Ticket ticket, Time now);
  void end_all(Time now);

  // Sends once; PostRefused reports a refusal. After `sent`, perform the effects; ask posted().
  PostResult post(const Command& command, Time now);
  // no_link also while it is unknown whether the board executes groups.
  PostResult post(const Setpoints& group, Time now);
  PostResult posted();
  // True if the board executes no groups: then a group's commands are posted one after the other.
  bool posts_apart() const { return board_.groups().state() == GroupSupport::State::apart; }

  // --- gates

  // The application watchdog: without feed() for `period` heartbeats and commands stop. 0: off.
  void watchdog(std::chrono::milliseconds period, Time now);
  void feed(Time now);
  // Holds back heartbeats and commands until it is called with false.
  void hold(bool held, Time now);

  // --- reports

  BoardRole board_role() const { return outbox_.role(); }
  const LinkStatus& link() const { return status_; }
  bool in_control(Time now) const { return keeper_.in_control(now); }
  DisarmCause disarmed_by() const { return arming_.cause(); }
  // True if the board has reported the cause that an E:CLEAR must name. Without it, an E:CLEAR
  // names the first cause that the board reports.
  bool knows_cause() const { return commands_.cause() != Command::unnamed_cause; }
  const ReceivedState& state() const { return board_.state(); }
  // The requested fields, as in F; empty: the board keeps its own choice.
  const std::string& fields() { return keeper_.fields().fields(); }
  Statistics statistics(Time now) const;
  const PacketCounters& packets() const { return paths_.counters(); }
  PathStatus path(std::size_t index, Time now) const { return paths_.report(index, now); }

 private:
  void on_state(std::size_t path, const Datagram& datagram, Time now);
  void on_heartbeat(std::size_t path, const Datagram& datagram, Time now);
  void on_identity(std::size_t path, const Datagram& datagram, Time now);
  void on_refusal(std::size_t path, const Datagram& datagram, Time now);
  void on_lease_refused(std::size_t path, const Nack& nack, Time now);
  bool counts(const Identity& identity) const;
  bool is_proof(const Nack& nack) const;

  PostResult gate_of_posts(CommandKind kind, Time now);
  void refresh(Time now);
  void advance_arming(Time now);
  void end_arming(Outcome outcome, Time now);
  void end_all_but_stops(Outcome outcome, Time now);
  void take_step_end(Time now);
  void on_restart(Time now);
  void on_new_boot(Time now);
  void forget_board(Time now);
  void begin_session();
  bool may_say_farewell() const;
  bool watches() const { return outbox_.watches(); }

  Effects effects_;
  const SessionOptions options_;
  std::function<std::uint64_t()> random_;
  HostLink link_;
  HostKey key_;
  Paths paths_;
  StatisticsCollector statistics_;
  HeardBoard board_;
  Outbox outbox_;
  LinkKeeper keeper_;
  CommandEnds ends_;
  ArmRequests arming_;
  CommandsUnderWay commands_;
  Posts posts_;
  LinkStatus status_;
};

// Posts a command or a group. If the board knows no groups, a group's commands go one after the
// other, up to the first that is not sent. send_all() sends the effects, and may advance `now`.
template <class What, class SendAll>
PostResult post_by(Session& session, const What& what, const Time& now, SendAll send_all) {
  if constexpr (std::is_same_v<What, Setpoints>) {
    if (session.posts_apart()) {
      PostResult result = PostResult::sent;
      for (std::size_t i = 0; i < what.size() && result; ++i) {
        result = post_by(session, what[i], now, send_all);
      }
      return result;
    }
  }
  const PostResult result = session.post(what, now);
  if (!result) return result;
  send_all();
  return session.posted();
}

}  // namespace r4
