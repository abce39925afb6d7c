// SPDX-License-Identifier: GPL-3.0-or-later
// The host's side of one board, without I/O: datagrams and time in, effects out (../link/effects.hpp).
//
// A session keeps the link alive, takes control, chooses the state fields that it needs, sends commands
// and finds out whether the board executed them. It calls nobody: after each call its effects are to be
// done, first what it sends, then what it reports.
//
//     datagram --> Paths --> HostLink, HeardBoard --> LinkKeeper --> ArmRequests --> CommandsUnderWay
//                  admits    what the board says      is control     may outputs     what is proved,
//                                                     ours?          be driven?      what goes out next
//
// Session owns these parts and the order in which a datagram, or time, passes through them: receive()
// and poll() show it.
//
// Every datagram goes out on each of the paths, written once and signed for each (outbox.hpp). What
// comes in is taken once, whichever path brings it first, and the newest has the newest T (paths.hpp).
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

// It has more than 40 functions: most are its interface, and hand over to one part each.
class Session {
 public:
  // `random` gives 64 random bits at each call.
  // Throws Error{usage} if options.fields are not state fields.
  explicit Session(
      SessionOptions options, BoardRole role = BoardRole::control, std::size_t paths = 1,
      std::function<std::uint64_t()> random = [] { return random_bits(); });
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  static constexpr std::size_t most_paths = 4;
  static constexpr std::size_t max_pending = CommandsUnderWay::max_pending;
  static constexpr std::size_t max_stops = CommandsUnderWay::max_stops;

  // --- effects

  // To be done after each call that takes a time. Each sending has to be told its result.
  Effects& effects() { return effects_; }
  void on_sent(const Sending& sending, SendResult result, Time now);

  // --- what happens. poll() is needed after each of these.

  // A datagram has come over that path.
  void receive(std::size_t path, std::string_view bytes, Time now);
  // The transport of a path has come or gone. Before it has come it is gone. `can_ask`: false where a
  // watcher may not send questions (a bus).
  void on_transport(std::size_t path, bool up, Time now, bool can_ask = true);
  // The trouble that all transports have.
  void on_trouble(TransportTrouble trouble) { keeper_.on_transport_trouble(trouble); }
  // This computer slept for longer than the board waits for its host, while `now` stood still. A new
  // session begins: it is disarmed, and every command under way but a stop is cancelled.
  // BoardRestarted reports it.
  void on_sleep(Time now);

  // Does what is due.
  void poll(Time now);
  // When poll() is needed next, at the latest.
  Time next_poll(Time now);

  // --- commands. CommandEnded reports the end, at the latest at `timeout` from now.

  // Throws Error{usage} for a command outside its ranges; returns 0 when 64 are under way already.
  Ticket send(const Command& command, Time timeout, Time now);
  // Commands that the board executes together or not at all. A board that knows no groups is sent one
  // after the other, each when the one before is confirmed. Throws Error{usage} for none.
  Ticket send(const Setpoints& group, Time timeout, Time now);
  // Clears what made the outputs safe, where that can be cleared, and closes relay 1, the motor supply:
  // confirmed when the board's state shows it. Output commands that are sent after it wait for it.
  Ticket arm(Time timeout, Time now);
  // E:STOP. Discards all other commands. Confirmed when the board reports that it has obeyed this very
  // stop. Returns 0, with the stop sent all the same, when 16 stops are under way already.
  Ticket stop(Time timeout, Time now);
  // Asks who the board is; BoardIdentified follows. Confirmed by the answer.
  Ticket identify(Time timeout, Time now);
  // Ends every command under way but stops, the heartbeats too, and says farewell: the board's outputs
  // are safe at once, and another host need not wait for the timeout. Confirmed when the board reports
  // it. Returns 0 if no board hears it, or the board knows no farewells. Only stops are sent afterwards.
  Ticket leave(Time timeout, Time now);
  bool leaving() const { return keeper_.is_leaving(); }
  // The same, but the commands end as cancelled. When the farewell has ended, change_role() lets the
  // session watch.
  Ticket release_control(Time timeout, Time now);
  // From now on the session controls, or only watches. It is disarmed, has a new id, and every command
  // under way but stops is cancelled. on_transport() is needed then for each path that is up.
  void change_role(BoardRole role, Time now);
  // Gives a command up, though it may have been executed. A stop goes on.
  void cancel(Ticket ticket, Time now);
  // Ends every command under way: the board is closed.
  void end_all(Time now);

  // Sends a command once and does not wait for it: PostRefused reports a refusal of the board. `sent`:
  // the command is among the effects, and posted() tells what became of it when they are done.
  PostResult post(const Command& command, Time now);
  // no_link also as long as it is not known whether the board executes groups.
  PostResult post(const Setpoints& group, Time now);
  PostResult posted();
  // True if the board executes no groups: then their commands are to be posted one after the other.
  bool posts_apart() const { return board_.groups().state() == GroupSupport::State::apart; }

  // --- gates

  // The application watchdog: without feed() for `period` the heartbeats stop, so that the board goes
  // safe, and commands are held back. 0 turns it off.
  void watchdog(std::chrono::milliseconds period, Time now);
  void feed(Time now);
  // Stops heartbeats and commands likewise, until it is called with false.
  void hold(bool held, Time now);

  // --- reports

  BoardRole board_role() const { return outbox_.role(); }
  const LinkStatus& link() const { return status_; }
  bool in_control(Time now) const { return keeper_.in_control(now); }
  // Why the session is not armed; none if it is.
  DisarmCause disarmed_by() const { return arming_.cause(); }
  bool may_drive() const { return arming_.may_drive(); }
  // True if the board has told which cause an E:CLEAR would have to name. An earlier E:CLEAR names the
  // first cause that is told.
  bool knows_cause() const { return commands_.cause() != Command::unnamed_cause; }
  const ReceivedState& state() const { return board_.state(); }
  // The fields that are asked for, as in F; empty: the board's own choice is left alone.
  const std::string& fields() const { return keeper_.fields().fields(); }
  Statistics statistics(Time now) const;
  // The board's datagrams.
  const PacketCounters& packets() const { return paths_.counters(); }
  // Everything but the name.
  PathStatus path(std::size_t index, Time now) const { return paths_.report(index, now); }

  static std::uint64_t random_bits();

 private:
  // The session's part in a datagram of the board, by kind.
  void on_state(std::size_t path, const Datagram& datagram, Time now);
  void on_heartbeat(std::size_t path, const Datagram& datagram, Time now);
  void on_identity(std::size_t path, const Datagram& datagram, Time now);
  void on_refusal(std::size_t path, const Datagram& datagram, Time now);
  void on_lease_refused(std::size_t path, const Nack& nack, Time now);
  bool counts(const Identity& identity) const;
  bool is_proof(const Nack& nack) const;

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

// Posts a command, or a group. `send_all()` sends the effects' datagrams. To a board that knows no
// groups the commands of a group go one after the other, up to the first that is not sent.
template <class What, class SendAll>
PostResult post_by(Session& session, const What& what, Time now, SendAll send_all) {
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
