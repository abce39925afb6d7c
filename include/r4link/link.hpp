// SPDX-License-Identifier: GPL-3.0-or-later
// The host's view of a link to a board: its health, the ends of commands, and the newest state.
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
#include "wiring/wiring.hpp"

namespace r4 {

// Time of the host's steady clock, in microseconds since an arbitrary start.
using Time = std::chrono::microseconds;

// The problems of a link, the gravest first.
enum class LinkCause : std::uint8_t {
  transport_down,  // the transports of all paths are down: unplugged or switched off
  two_boards,      // the paths lead to two boards; no state is accepted
  watchdog,        // feed() is not called: no heartbeats or commands are sent
  callback,        // a callback of the program does not return: no heartbeats or commands are sent
  foreign_frames,  // another protocol uses the board's command id (CAN)
  busy,            // another host controls the board
  board_has_no_key,  // this program has a key, but the board needs no signature
  key_needed,        // the board needs a signature, but this program has no key
  key_not_taken,     // the board rejects this program's signatures or does not receive them
  watchers_full,     // the board has no room for another watcher
  not_watchable,     // the board's firmware streams only to the controlling host
  late_frames,       // the board's flow control frames are late (CAN)
  other_board,       // a path leads to another board and is not used; the link works
};
// The enumerator's name with spaces: "transport down", "two boards" …
R4LINK_API const char* to_text(LinkCause cause);

// A set of causes. A loop over the set starts with the gravest cause.
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
  // The gravest cause; none if the set is empty.
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

// docs/how-to/redundancy.md. A board's only path is never asking or other_board.
enum class PathState : std::uint8_t {
  down,         // the transport is down or not opened
  asking,       // the transport is up, but the board's identity is unknown
  other_board,  // the path leads to another board: only stops and Q:ID are sent
  silent,       // the board has been silent for the timeout
  carrying,
};
// "down", "asking", "other board", "silent", "carrying".
R4LINK_API const char* to_text(PathState state);

struct LinkStatus {
  HostLinkState state = HostLinkState::connecting;
  SafeReason reason = SafeReason::none;  // why the board is safe
  LinkCauses causes{};
  bool in_control = false;    // the board accepts this host's commands, which are sent at once
  std::uint8_t carrying = 0;  // the paths that carry: bit 0 is the first
  ChipFault chip{};           // if a chip causes SafeReason::fault: the chip

  std::optional<LinkCause> cause() const { return causes.first(); }
  // True if the link cannot begin because the paths lead to two boards.
  bool cannot_begin() const {
    return state == HostLinkState::connecting && causes.has(LinkCause::two_boards);
  }
  // True if heartbeats and commands are held back because the program may hang.
  bool gated() const { return causes.has_any({LinkCause::watchdog, LinkCause::callback}); }
  friend bool operator==(const LinkStatus&, const LinkStatus&) = default;
};

// Whether a program must call arm() before output commands.
enum class Arming : std::uint8_t {
  required,
  off,  // output commands are sent whenever the link is up
};

enum class DisarmCause : std::uint8_t {
  none,     // the program is armed
  not_yet,  // arm() has not been called
  stop,
  handle,
  proximity,  // an ultrasonic sensor measured less than its threshold
  watchdog,   // a task of the firmware missed its deadline
  fault,      // a chip does not answer, or the firmware found a fault
  link,       // the link was lost, and the board did not restore the outputs
  restart,
  supply,  // relay 1, the motor supply, opened
  sleep,   // this computer slept for longer than the board's timeout
  // Causes that may be older than the program: arm() does not clear them, Command::clear() does.
  earlier_stop,
  earlier_watchdog,
  earlier_fault,  // or a fault with which the board begins
};
// "stop", "not yet", "earlier stop" …
R4LINK_API const char* to_text(DisarmCause cause);
// True if only Command::clear() clears the cause.
constexpr bool is_earlier(DisarmCause cause) { return cause >= DisarmCause::earlier_stop; }

struct CommandResult {
  Outcome outcome = Outcome::timed_out;
  Refusal code = Refusal::none;              // for refused
  Time elapsed{0};                           // from the call to the end of the command
  DisarmCause disarmed = DisarmCause::none;  // for not_armed
  // For a group, `at` is the number of the refused command, from 1; 0: no particular command. If
  // the commands are sent one by one, `at` is the command that was under way at the end.
  // `executed`: the number of commands before `at` that were executed.
  std::uint8_t at = 0;
  std::uint8_t executed = 0;
  // Packet number of the command, as in I2CX of the state. 0: not sent.
  std::uint32_t pnum = 0;
  // `step`: the failed step of a Device's set-up, from 1. `transfer`: the answer to
  // async_transfer() or to the failed step. If a transfer timed out and `executed` is
  // 1, the transfer had begun.
  std::uint16_t step = 0;
  I2cAnswer transfer{};
};

// The result of post(). True if the command was sent:
//     if (!board.post(setpoint)) …        if (board.post(setpoint) == PostResult::not_armed) …
class PostResult {
 public:
  enum Value : std::uint8_t {
    sent,
    not_armed,  // an output command while the program is not armed: call arm()
    no_link,    // the link is not up, or the board does not accept this host's commands
    // too many commands wait, or a group waits or is sent one by one: try again later
    queue_full,
    // waited for more than 100 ms, because the thread of the link stood still; not a command that
    // switches an output off
    late,
  };
  PostResult(Value value, std::uint32_t pnum = 0)  // NOLINT(google-explicit-constructor)
      : value_(value), pnum_(pnum) {}
  operator bool() const { return value_ == sent; }  // NOLINT(google-explicit-constructor)
  Value value() const { return value_; }            // for a switch
  // Packet number of the sent command, as in CMD of the state. With Setpoints, of the last
  // command. 0: not sent, a stop, or posted by a Board.
  std::uint32_t pnum() const { return pnum_; }
  friend bool operator==(PostResult a, PostResult b) { return a.value_ == b.value_; }
  friend bool operator==(PostResult a, Value b) { return a.value_ == b; }

 private:
  Value value_;
  std::uint32_t pnum_;
};
R4LINK_API const char* to_text(PostResult result);

struct RefusedPost {
  Command command;               // its texts are empty
  Refusal code = Refusal::none;  // the board's refusal; none if not sent: see `why`
  PostResult why = PostResult::sent;
  // If a group was refused, no command was executed. `at`: the number of `command` in the group,
  // from 1. If `at` is 0, the refusal concerns the whole group, and `command` is its first command.
  std::uint8_t at = 0;
  std::uint8_t group = 1;  // number of commands in the group
};

// A field that a datagram lacks keeps its value until the board restarts. Values in `present` are
// as old as age(), other values are older. Heartbeats also update `safe`.
struct ReceivedState : State {
  using Clock = std::chrono::steady_clock;

  // The fields that the board has reported since it started. Other fields read 0.
  FieldSet reported;
  // The arrival of the newest datagram.
  Clock::time_point received = never;
  // Clock::time_point::min() before the first state since the board started.
  static constexpr Clock::time_point never = Clock::time_point::min();
  // The instant when the board's clock began to show t_ms, on this computer's clock, estimated from
  // arrival times and answers. The board reads its inputs within a millisecond after this instant.
  Clock::time_point sampled = never;
  // Largest error of `sampled`. Before the first answer, and for a watcher on CAN, which sends no
  // questions: `unknown`. The sample was then not later than `sampled`.
  Clock::duration sampled_error = unknown;
  static constexpr Clock::duration unknown = Clock::duration::max();
  bool any() const { return received != never; }
  // Time since the arrival; Clock::duration::max() before the first state.
  Clock::duration age(Clock::time_point now = Clock::now()) const {
    return any() ? now - received : Clock::duration::max();
  }
  // `sampled` by the present setting of the system clock. Requires any().
  std::chrono::system_clock::time_point sampled_at_wall_time() const {
    return std::chrono::system_clock::now() +
           std::chrono::round<std::chrono::system_clock::duration>(sampled - Clock::now());
  }
};

struct BoardIdentity {
  std::string firmware;
  std::string board_id;
  std::string capabilities;             // words joined by '+': "udp+serial"
  std::string name;                     // set by the owner; may be empty
  std::optional<BoardWiring> wiring{};  // after Command::ask_wiring()
};

struct Statistics {
  // Datagrams from the board
  std::uint64_t received = 0;  // valid
  std::uint64_t states = 0;
  std::uint64_t damaged = 0;  // bad checksum, syntax or length
  std::uint64_t copies = 0;   // duplicates, on the same or another path; not counted in `received`
  // lost: not received on any path. duplicate: received before. restarts: of the board, by its
  // clock. A sleep of this computer for longer than the board's timeout counts as a restart.
  PacketCounters packets;
  double state_rate_hz = 0;  // over the last second
  // Times in microseconds; 0 until measured
  double round_trip_us = 0;  // of the newest question and answer
  double round_trip_min_us = 0;
  double round_trip_mean_us = 0;
  double jitter_us = 0;     // interarrival jitter of the states (RFC 3550 6.4.1)
  double state_age_us = 0;  // since the newest state arrived
  // Parts per million by which the board's clock is slower than this computer's; 0 until known
  double clock_drift_ppm = 0;
  double clock_drift_error_ppm = 0;
  // Datagrams from this host
  std::uint64_t heartbeats = 0;
  std::uint64_t commands = 0;  // without retries
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

struct PathStatus {
  std::string name;  // the transport's name, for people
  PathState state = PathState::down;
  bool busy = false;         // the board on this path reports that another host controls it
  std::string board_id;      // of the board that answered last on this path
  PacketCounters packets;    // counts of this path; restarts: of its packet numbers
  std::uint64_t copies = 0;  // datagrams received before on this or another path
  double round_trip_us = 0;  // us, of the newest question and answer; 0: none
  double age_us = 0;         // us since the newest datagram; 0: none
  // Lost share of the board's datagrams, 0-1.
  double loss() const {
    const double all = static_cast<double>(packets.received) + packets.lost;
    return all > 0 ? packets.lost / all : 0;
  }
};

// Advice if a stop is not confirmed.
inline constexpr std::string_view stop_last_resort = "CUT THE POWER if it must stop now";

// The state of the link and the fix: "another host controls the board", "stop it, or …". `name`:
// the board's name. All explain() return a problem of kind refused.
R4LINK_API Problem explain(std::string_view name, const LinkStatus& link);

// The paths that lead to two boards, and the fix.
R4LINK_API Problem explain(const std::vector<PathStatus>& paths);

R4LINK_API Problem explain(LinkCause cause);

// Why the session is not armed, and the fix. `cause`: not none. `what`: the request that failed.
R4LINK_API Problem explain(std::string_view what, DisarmCause cause);

// Why a command or a group was not confirmed. `link`: the link at that time.
R4LINK_API Problem explain(const Command& command, const CommandResult& result,
                           const LinkStatus& link);
R4LINK_API Problem explain(const Setpoints& group, const CommandResult& result,
                           const LinkStatus& link);
// `request`: the name of a request that is not a command, "arm()".
R4LINK_API Problem explain(std::string_view request, const CommandResult& result,
                           const LinkStatus& link);

}  // namespace r4
