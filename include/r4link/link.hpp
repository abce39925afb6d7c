// SPDX-License-Identifier: GPL-3.0-or-later
// What a host knows of its link to a board: how it is, how well it does, what became of commands, and the
// newest state.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "carrier.hpp"
#include "command.hpp"
#include "config.hpp"
#include "error.hpp"
#include "state.hpp"
#include "vocabulary.hpp"

namespace r4 {

// Time of the host's steady clock; any start.
using Time = std::chrono::microseconds;

// --- how the link is

// Do our heartbeats and commands go out?
enum class Gate : std::uint8_t {
  open,
  watchdog,  // no: the application watchdog was not fed
  callback,  // no: a callback of the program does not return
};

// What is wrong with keys.
enum class KeyTrouble : std::uint8_t {
  none,
  board_has_none,  // we have a key, and the board asks for no signature
  needed,          // the board asks for a signature, and we have no key
  not_taken,       // the board takes nothing that we sign, or does not hear it
};
// "none", "board has none", "needed", "not taken".
R4LINK_API const char* to_text(KeyTrouble trouble);

// Why the board does not stream to a program that only watches.
enum class LeaseTrouble : std::uint8_t {
  none,
  full,     // as many watch it already as it serves
  unknown,  // its firmware serves nobody who does not control it
};
// "none", "full", "unknown".
R4LINK_API const char* to_text(LeaseTrouble trouble);

// How one of the paths to a board is (docs/redundancy.md). The only path of a board is never asking or other_board.
enum class PathState : std::uint8_t {
  down,         // its transport is gone, or could not be opened yet
  asking,       // it is up, and the board there has not said yet who it is
  other_board,  // another board is there: nothing but stops is sent on it
  silent,       // the board is there, and nothing came for the timeout
  carrying,
};
// "down", "asking", "other board", "silent", "carrying".
R4LINK_API const char* to_text(PathState state);

struct LinkStatus {
  HostLinkState state = HostLinkState::connecting;
  SafeReason reason = SafeReason::none;  // why the board is safe
  bool busy = false;                     // another host controls the board
  TransportTrouble trouble =
      TransportTrouble::none;  // foreign_frames: what keeps us busy is no R4 host
  Gate gate = Gate::open;
  KeyTrouble key = KeyTrouble::none;
  LeaseTrouble lease = LeaseTrouble::none;
  bool in_control = false;  // the board takes our commands: they go out at once
  bool transport_down =
      false;  // it is gone: unplugged, its interface switched off. Of several: all are
  std::uint8_t carrying = 0;  // the paths that carry: bit 0 is the first
  bool two_boards = false;    // a path leads to another board than the rest
  ChipFault chip{};           // of a fault: the chip that is the cause, if it is one
  bool gated() const { return gate != Gate::open; }
  friend bool operator==(const LinkStatus&, const LinkStatus&) = default;
};

// --- whether the program may drive

// Must a program be armed to drive?
enum class Arming : std::uint8_t {
  required,
  off,  // output commands go out whenever the link is up
};

// Why a program is not armed.
enum class DisarmCause : std::uint8_t {
  none,       // it is armed
  not_yet,    // arm() was not called yet
  stop,       // an emergency stop
  handle,     // the dead-man's handle was released
  proximity,  // something came nearer than a threshold
  watchdog,   // a duty of the board missed its deadline
  fault,      // the board found a fault in itself
  link,       // the link was lost, and the board did not bring its outputs back
  restart,    // the board restarted
  supply,     // relay 1, the motor supply, was opened
  sleep,      // this computer slept for longer than the board waits for its host
  // arm() has found one of these that may have come before the program began, and does not clear
  // it: clear() does
  earlier_stop,
  earlier_watchdog,
  earlier_fault,
};
// "stop", "not yet", "earlier stop" …
R4LINK_API const char* to_text(DisarmCause cause);
// True of a cause that may have come before the program began.
constexpr bool is_earlier(DisarmCause cause) { return cause >= DisarmCause::earlier_stop; }

// --- what became of a command

// Of one that was waited for.
struct CommandResult {
  Outcome outcome = Outcome::timed_out;
  Refusal code = Refusal::none;              // for refused
  Time elapsed{0};                           // from the call to its end
  DisarmCause disarmed = DisarmCause::none;  // for not_armed
  // Of a group: which of its commands it was that the board refused, or that was under way where they are
  // sent one after the other, from 1; 0: none in particular. Of those before it, how many were executed.
  std::uint8_t at = 0;
  std::uint8_t executed = 0;
  // Of the datagram that carried it: what comes later, I2CX of the state, names the command by it. 0: it was
  // not sent.
  std::uint32_t pnum = 0;
  // Of a device that was to be set up and was not (Device): which of its steps failed, from 1, and of one that is a
  // transfer how that ended, if it did.
  std::uint16_t step = 0;
  I2cAnswer transfer{};
};

// Of one that is sent once and not waited for. True where it was sent:
//
//     if (!board.post(setpoint)) …        if (board.post(setpoint) == PostResult::not_armed) …
class PostResult {
 public:
  enum Value : std::uint8_t {
    sent,
    not_armed,  // it drives an output, and the program is not armed: call arm()
    no_link,    // the link is not up, or the board does not take our commands yet
    queue_full,  // too many wait to be sent already, or a group waits, or is sent command by command:
                 // try again later
  };
  PostResult(Value value) : value_(value) {}        // NOLINT(google-explicit-constructor)
  operator bool() const { return value_ == sent; }  // NOLINT(google-explicit-constructor)
  Value value() const { return value_; }            // for a switch
  friend bool operator==(PostResult a, PostResult b) { return a.value_ == b.value_; }
  friend bool operator==(PostResult a, Value b) { return a.value_ == b; }

 private:
  Value value_;
};
// "sent", "not armed", "no link", "queue full".
R4LINK_API const char* to_text(PostResult result);

// A command that post() took and that was not executed.
struct RefusedPost {
  Command command;               // without its texts
  Refusal code = Refusal::none;  // of the board; none where it did not get there: `why`
  PostResult why = PostResult::sent;
  // Of a group none was executed. `command` is the one that the board could not execute, the `at`th; its
  // first, if none in particular was in the way (at 0).
  std::uint8_t at = 0;
  std::uint8_t group = 1;  // how many commands it has
};

// --- what the board says

// The board's state as the host has it, with the time at which it came.
//
// Fields that a datagram does not carry keep their value, as State says, within one boot of the board:
// with a restart everything is forgotten. `safe` is also kept up to date by heartbeats, which go on when
// states do not; everything else is as old as age() says, however well it looks.
struct ReceivedState : State {
  using Clock = std::chrono::steady_clock;

  // When its newest datagram came.
  Clock::time_point received = never;
  // Clock::time_point::min() while none has come since the board began.
  static constexpr Clock::time_point never = Clock::time_point::min();
  // When the board sampled it: the instant at which its clock began to show t_ms, estimated on this
  // computer's from when its datagrams came and questions were answered. The board reads its inputs in the
  // first turn of its loop after that instant, within a millisecond.
  Clock::time_point sampled = never;
  // The instant is no farther from `sampled` than this; `unknown` where nothing has been answered yet, and
  // for who watches on CAN, who asks nothing: then it was not later.
  Clock::duration sampled_error = unknown;
  static constexpr Clock::duration unknown = Clock::duration::max();
  bool any() const { return received != never; }
  // How long ago that was; Clock::duration::max() while none has come.
  Clock::duration age(Clock::time_point now = Clock::now()) const {
    return any() ? now - received : Clock::duration::max();
  }
  // The same instant by the calendar's clock as it is set now. Only if any().
  std::chrono::system_clock::time_point sampled_at_wall_time() const {
    return std::chrono::system_clock::now() +
           std::chrono::round<std::chrono::system_clock::duration>(sampled - Clock::now());
  }
};

// Who the board is.
struct BoardIdentity {
  std::string firmware;
  std::string board_id;
  std::string capabilities;  // words joined by '+': "udp+serial"
  std::string name;          // that its owner gave it; empty: none
};

// How well the link does.
struct Statistics {
  // Datagrams of the board
  std::uint64_t received = 0;  // valid ones
  std::uint64_t states = 0;
  std::uint64_t damaged = 0;  // bad checksum, syntax or length
  std::uint64_t copies = 0;   // what had been brought before; not among `received`
  // lost, duplicate, late: lost is what no path has brought, a duplicate what one had brought
  // before. `restarts` are those of the board, as its clock tells them: a sleep of this computer
  // that is longer than the board's timeout counts as one.
  PacketCounters packets;
  double state_rate_hz = 0;  // over the last second
  // Time, microseconds; 0 where nothing was measured yet
  double round_trip_us = 0;  // question to answer, the newest
  double round_trip_min_us = 0;
  double round_trip_mean_us = 0;
  double jitter_us = 0;     // interarrival jitter of the states (RFC 3550 6.4.1)
  double state_age_us = 0;  // since the newest state arrived
  // Parts in a million by which the board's clock is slower than this computer's; both 0 until known
  double clock_drift_ppm = 0;
  double clock_drift_error_ppm = 0;
  // Datagrams of ours
  std::uint64_t heartbeats = 0;
  std::uint64_t commands = 0;  // retries not counted
  std::uint64_t retries = 0;
  std::uint64_t confirmed = 0;
  std::uint64_t refused = 0;
  std::uint64_t timed_out = 0;
  // Lost share of the board's datagrams, 0-1.
  double loss() const {
    const double all = static_cast<double>(received) + packets.lost;
    return all > 0 ? packets.lost / all : 0;
  }
};

// One of the paths to a board, and how well it does.
struct PathStatus {
  std::string name;  // of its transport, for people
  PathState state = PathState::down;
  bool busy = false;         // the board there answers that another host controls it
  std::string board_id;      // the board that answered there last
  PacketCounters packets;    // of the board's datagrams on this path; `restarts`: of their numbers
  std::uint64_t copies = 0;  // of them, what another path had brought before
  double round_trip_us = 0;  // question to answer, the newest; 0: none yet
  double age_us = 0;         // since the newest datagram; 0: none yet
  // Lost share of the board's datagrams, 0-1.
  double loss() const {
    const double all = static_cast<double>(packets.received) + packets.lost;
    return all > 0 ? packets.lost / all : 0;
  }
};

// --- in words

// What to do where a stop is not confirmed.
inline constexpr std::string_view stop_last_resort = "CUT THE POWER if it must stop now";

// How the link is and, where something is wrong with it, what to do: "another host controls the
// board" and "stop it, or …". `name` is the board's. Of kind refused.
R4LINK_API Problem explain(std::string_view name, const LinkStatus& link);

// Which of the paths leads to another board, and what to do; of kind refused.
R4LINK_API Problem explain(const std::vector<PathStatus>& paths);

// What is wrong with keys, and what to do; of kind refused. Not for KeyTrouble::none.
R4LINK_API Problem explain(KeyTrouble trouble);

// Why the board does not stream to a program that only watches, and what to do; of kind refused. Not for
// LeaseTrouble::none.
R4LINK_API Problem explain(LeaseTrouble trouble);

// Why the session is not armed, and what to do; of kind refused. Not for DisarmCause::none.
R4LINK_API Problem explain(std::string_view command, DisarmCause cause);

// Why `command` ("O:358,1,1") was not confirmed. `link` is the link at that time. Of kind refused.
R4LINK_API Problem explain(std::string_view command, const CommandResult& result,
                           const LinkStatus& link);

}  // namespace r4
