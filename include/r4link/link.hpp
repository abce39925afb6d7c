// SPDX-License-Identifier: GPL-3.0-or-later
// What a host knows of its link to a board: how it is, how well it does, what became of commands, and the
// newest state.
#pragma once

#include <bit>
#include <chrono>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "carrier.hpp"
#include "command.hpp"
#include "config.hpp"
#include "error.hpp"
#include "setpoints.hpp"
#include "state.hpp"
#include "vocabulary.hpp"

namespace r4 {

// Time of the host's steady clock; any start.
using Time = std::chrono::microseconds;

// --- how the link is

// What is wrong with a link, in order of gravity: the first one that holds is the gravest.
enum class LinkCause : std::uint8_t {
  transport_down,    // its transport is down (of several: all are): unplugged, or switched off
  two_boards,        // its paths lead to two boards, and no state is heard
  watchdog,          // the application watchdog was not fed: no heartbeat or command is sent
  callback,          // a callback of the program does not return: no heartbeat or command is sent
  foreign_frames,    // another protocol uses the board's command id (CAN)
  busy,              // another host controls the board
  board_has_no_key,  // this program has a key, and the board asks for no signature
  key_needed,        // the board asks for a signature, and this program has no key
  key_not_taken,     // the board does not accept this program's signature, or does not hear it
  watchers_full,     // the board already streams to as many watchers as it can
  not_watchable,     // the board's firmware streams only to the controlling host
  late_frames,       // the board's flow control comes too late (CAN)
  other_board,       // a path leads to another board and is not used, but the link is up
};
// "transport down", "two boards", "watchdog", "callback", "foreign frames", "busy",
// "board has no key", "key needed", "key not taken", "watchers full", "not watchable",
// "late frames", "other board".
R4LINK_API const char* to_text(LinkCause cause);

// A set of causes. A loop over it begins with the gravest.
class LinkCauses {
 public:
  struct Iterator {
    std::uint32_t left;
    constexpr LinkCause operator*() const { return static_cast<LinkCause>(std::countr_zero(left)); }
    constexpr Iterator& operator++() {
      left &= left - 1;
      return *this;
    }
    friend constexpr bool operator==(const Iterator&, const Iterator&) = default;
  };

  constexpr LinkCauses() = default;
  constexpr LinkCauses(std::initializer_list<LinkCause> causes) {
    for (const LinkCause cause : causes) set(cause);
  }

  constexpr void set(LinkCause cause, bool holds = true) {
    bits_ = holds ? bits_ | bit(cause) : bits_ & ~bit(cause);
  }
  constexpr bool empty() const { return bits_ == 0; }
  constexpr bool has(LinkCause cause) const { return (bits_ & bit(cause)) != 0; }
  constexpr bool has_any(LinkCauses of) const { return (bits_ & of.bits_) != 0; }
  constexpr LinkCauses without(LinkCauses others) const {
    LinkCauses rest;
    rest.bits_ = bits_ & ~others.bits_;
    return rest;
  }
  // The gravest.
  constexpr std::optional<LinkCause> first() const {
    return empty() ? std::nullopt : std::optional(*begin());
  }
  constexpr Iterator begin() const { return {bits_}; }
  constexpr Iterator end() const { return {0}; }
  friend constexpr bool operator==(const LinkCauses&, const LinkCauses&) = default;

 private:
  static constexpr std::uint32_t bit(LinkCause cause) { return 1U << static_cast<unsigned>(cause); }

  std::uint32_t bits_ = 0;
};

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
  LinkCauses causes{};                   // what is wrong with the link
  bool in_control = false;               // the board takes our commands: they go out at once
  std::uint8_t carrying = 0;             // the paths that carry: bit 0 is the first
  ChipFault chip{};                      // of a fault: the chip that is the cause, if it is one

  // The gravest.
  std::optional<LinkCause> cause() const { return causes.first(); }
  // True if heartbeats and commands are held back because the program seems to hang.
  bool gated() const { return causes.has_any({LinkCause::watchdog, LinkCause::callback}); }
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
  // it: Command::clear() does
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

// What is wrong with a link, and what to do; of kind refused.
R4LINK_API Problem explain(LinkCause cause);

// Why the session is not armed, and what to do; of kind refused. Not for DisarmCause::none. `what`
// names what was asked for.
R4LINK_API Problem explain(std::string_view what, DisarmCause cause);

// Why a command or a group was not confirmed. `link` is the link at that time. Of kind refused.
R4LINK_API Problem explain(const Command& command, const CommandResult& result,
                           const LinkStatus& link);
R4LINK_API Problem explain(const Setpoints& group, const CommandResult& result,
                           const LinkStatus& link);
// The same for a request that is not a command, by its name: "arm()".
R4LINK_API Problem explain(std::string_view request, const CommandResult& result,
                           const LinkStatus& link);

}  // namespace r4
