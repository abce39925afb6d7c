// SPDX-License-Identifier: GPL-3.0-or-later
// The host's side of one board, without I/O: datagrams and time in, effects out
// (../link/effects.hpp). Each datagram is written once and signed for each path (outbox.hpp).
//   datagram --> Paths --> HostLink, HeardBoard --> LinkKeeper --> ArmRequests --> CommandsUnderWay
//                admits    the board's state        control        arming          ends of
//                                                                                  commands
//
// Session owns these parts. receive() and poll() call them in this order.
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

// More than 40 functions, most of which call one part.
class Session {
 public:
  // `random`: 64 random bits; default: the system's. Throws Error{usage} for invalid fields.
  explicit Session(SessionOptions options, BoardRole role = BoardRole::control,
                   std::size_t paths = 1, std::function<std::uint64_t()> random = {});
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  static constexpr std::size_t most_paths = 4;
  static constexpr std::size_t max_pending = CommandsUnderWay::max_pending;
  static constexpr std::size_t max_stops = CommandsUnderWay::max_stops;

  // After each call with a time, perform the sendings (with on_sent() for each), then the reports.
  Effects& effects() { return effects_; }
  void on_sent(const Sending& sending, SendResult result, Time now);

  // --- events. poll() is needed after each of these.

  void receive(std::size_t path, std::string_view bytes, Time now);
  // Initially every transport is down. `can_ask`: false if a watcher must not send Q:ID (on a bus).
  void on_transport(std::size_t path, bool up, Time now, bool can_ask = true);
  void on_trouble(TransportTrouble trouble) { keeper_.on_transport_trouble(trouble); }
  // This computer slept for longer than the board's timeout, while `now` stopped. A new, disarmed
  // session begins, all commands except stops are cancelled, and BoardRestarted is reported.
  void on_sleep(Time now);

  void poll(Time now);
  Time next_poll(Time now);

  // --- commands. CommandEnded reports the end, at most `timeout` after `now`.

  // Throws Error{usage} for a command outside its ranges. Returns 0 if 64 commands are under way.
  // Command::identify(): the answer confirms it, and an Identity is reported. Command::stop():
  // cancels all other commands, and is confirmed when the board reports this stop's number. If 16
  // stops are under way, returns 0 but sends the stop.
  Ticket send(const Command& command, Time timeout, Time now);
  // Commands run together or, without groups, singly. Throws Error{usage} for an empty group.
  Ticket send(const Setpoints& group, Time timeout, Time now);
  // Clears the cause of the safe state, if possible, and closes relay 1, the motor supply. The
  // board's state confirms the arming. Later output commands wait for the end of arm().
  Ticket arm(Time timeout, Time now);
  // Ends heartbeats and all commands except stops, and sends the farewell: the outputs are safe at
  // once, and another host need not wait for the timeout. The board's report confirms the farewell.
  // Returns 0 without a link, or if the board lacks the farewell. After leave(), only stops are
  // sent, until change_role(). `outcome`: of the ended commands.
  Ticket leave(Time timeout, Time now, Outcome outcome = Outcome::closed);
  bool leaving() const { return keeper_.is_leaving(); }
  // The session is then disarmed and has a new id. All commands under way except stops are
  // cancelled. on_transport() must follow for each path that is up.
  void change_role(BoardRole role, Time now);
  // Gives up a command, which the board may execute. A stop continues.
  void cancel(Ticket ticket, Time now);
  void end_all(Time now);

  // Sends once; RefusedPost reports a refusal. After `sent`, perform the effects, then call
  // posted().
  PostResult post(const Command& command, Time now);
  // Until the board has reported whether it executes groups, also returns no_link.
  PostResult post(const Setpoints& group, Time now);
  PostResult posted();
  // True if the board executes no groups: post a group's commands one after the other.
  bool posts_apart() const { return board_.groups().state() == GroupSupport::State::apart; }

  // The application watchdog: without feed() for `period`, heartbeats and commands stop. 0: off.
  void watchdog(std::chrono::milliseconds period, Time now);
  void feed(Time now);
  // True: holds back heartbeats and commands. False: resumes both.
  void hold(bool held, Time now);

  BoardRole board_role() const { return outbox_.role(); }
  const LinkStatus& link() const { return status_; }
  bool in_control(Time now) const { return keeper_.in_control(now); }
  DisarmCause disarmed_by() const { return arming_.cause(); }
  // True after the first heartbeat. Before, an E:CLEAR names the board's first reported cause.
  bool knows_cause() const { return commands_.cause() != Command::unnamed_cause; }
  const ReceivedState& state() const { return board_.state(); }
  const std::string& fields() { return keeper_.fields().fields(); }
  Statistics statistics(Time now) const;
  const PacketCounters& packets() const { return paths_.counters(); }
  PathStatus path(std::size_t index, Time now) const { return paths_.report(index, now); }

 private:
  void on_state(std::size_t path, const Datagram& datagram, Time now);
  void on_heartbeat(std::size_t path, const Datagram& datagram, Time now);
  void on_identity(std::size_t path, const Datagram& datagram, Time now);
  void on_refusal(std::size_t path, const Datagram& datagram, Time now);
  bool admitted(Paths::Admission admission, Time now);
  bool is_proof(const Nack& nack) const;

  PostResult gate_of_posts(CommandKind kind, Time now);
  void refresh(Time now);
  void advance_arming(Time now);
  void end_all_but_stops(Outcome outcome, Time now);
  void take_step_end(Time now);
  void on_restart(Time now);
  void on_new_boot(Time now);
  void on_failed_stop(Time now);
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
  ArmRequests arming_;
  CommandsUnderWay commands_;
  Posts posts_;
  LinkStatus status_;
};

// True if the board is ready for commands or, for a watcher, heard: what wait_active() waits for.
// The watchdog and a hanging callback also end `in_control`.
inline bool is_ready(BoardRole role, const LinkStatus& link) {
  return role == BoardRole::watch ? is_heard(link.state)
                                  : link.state == HostLinkState::active && link.in_control;
}

// Posts a command or a group. For a board without groups, the commands are posted one after the
// other, up to the first command that is not sent. send_all() sends the effects, and may advance
// `now`.
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
