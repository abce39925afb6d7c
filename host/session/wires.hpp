// SPDX-License-Identifier: GPL-3.0-or-later
// The wires over which one session has its board: what each brings, and which of them carry. Without I/O, part
// of a session (docs/redundancy.md). Of one wire all this is what the session knows anyway.
//
//             up           its board says who it is           something comes
//     down -------> asking ------------------------> silent <----------------> carrying
//                    |  ^                                     for the timeout
//        another is  |  |   it is asked every second,        nothing
//        there       v  |   and says who it is
//                   other
//
//     down leads out of each of them to `down`; an answer of another board from each to `other`
//
// Until its board has said who it is, a wire is sent nothing but the question and stops, and what it brings is
// passed over. The board that answers first is the session's, unless all other wires lead elsewhere. The session begins
// when all wires that are up have answered, or 300 ms after the first.
//
// Each wire has the board's packet numbers of its own; so what is newest is told by T (host_link.hpp). A wire also
// has its view of the board's clock, by the answers to its own questions alone: a T that does not fit it, of a board
// that has begun again or of a wire that brings what is old, is passed over, and the wire is asked. An answer that
// was asked for after the newest other answer, and whose T fits no more, shows that the board has begun again.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "../../protocol/link/host_link.hpp"
#include "../../protocol/link/packet_tracker.hpp"
#include "../../protocol/messages/message.hpp"
#include "../measurement/identity_question.hpp"
#include "lease.hpp"
#include "r4link/link.hpp"
#include "time.hpp"

namespace r4 {

// A set of wires: bit i is the wire i.
using WireSet = std::uint8_t;
constexpr WireSet wire_bit(std::size_t index) { return static_cast<WireSet>(1U << index); }

class Wires {
 public:
  Wires(std::size_t count, LinkTiming timing) : wires_(count), timeout_(timeout_of(timing)) {}

  bool several() const { return wires_.size() > 1; }
  std::size_t count() const { return wires_.size(); }
  Lease& lease(std::size_t index) { return wires_[index].lease; }
  const Lease& lease(std::size_t index) const { return wires_[index].lease; }

  // `can_ask`: not where who watches may say nothing, on a bus. Such a wire is believed what its URL says while it is the
  // only one; beside others the T that it brings must fit the board's clock, which begins at random.
  void on_transport(std::size_t index, bool up, bool can_ask, Time now);
  bool all_down() const;
  // This computer slept: who the board is counts on, but each wire has to say again what the
  // board's clock is.
  void on_sleep(Time now);

  // --- who is there

  // The wires that are to be asked now, by one question.
  WireSet to_ask(Time now) const;
  void asked(std::size_t index, std::uint32_t pnum, Time now);
  enum class Answer : std::uint8_t {
    nothing,  // nobody has asked
    other,    // another board is there
    known,
    restarted,  // it has begun again
  };
  // `link`: what the session knows of the board's clock.
  Answer on_identity(std::size_t index, const Identity& identity, std::uint32_t t_ms,
                     const HostLink& link, Time now);

  // Those to which the session may speak: none before it has begun.
  WireSet speaking() const { return begun_ ? known() : WireSet{0}; }
  bool begun() const { return begun_; }
  bool is_known(std::size_t index) const { return wires_[index].known; }
  bool two_boards() const;
  // Lets time pass; true if the session begins.
  bool poll(Time now);
  Time next(Time now) const;

  // --- what comes

  enum class Take : std::uint8_t {
    no,
    connecting,  // the board is booting: each wire that is heard says so
    restarted,   // the board has begun again; else as yes
    yes,         // if its T is newer
  };
  // A state or a heartbeat. `fits`: its T is of the boot that the session knows.
  Take on_datagram(std::size_t index, std::uint32_t pnum, std::uint32_t t_ms, bool fits, Time now);
  // A heartbeat that says that the board is booting.
  Take on_connecting(std::size_t index, Time now);
  // N or I. `counts`: its number is among those of the states.
  Take on_answer(std::size_t index, std::uint32_t pnum, std::uint32_t t_ms, bool fits, bool counts,
                 Time now);
  // What on_datagram() let through was new, or a copy.
  void taken(std::size_t index);
  void copy(std::size_t index);
  // Of one wire, where nobody asks for more.
  void heard(Time now) { wires_[0].heard = now; }

  // The board, at its time `t_ms`, has answered BUSY there: that place is not its host's.
  void on_busy(std::size_t index, std::uint32_t t_ms, Time now);
  // A state of its time `t_ms` shows that the board is ours: a BUSY from before that says nothing any more.
  void on_own_state(std::uint32_t t_ms, Time now);
  // Do all that are heard say that another host has the board?
  bool all_busy(Time now) const;
  // For so long they do, if none is answered again.
  Time all_busy_until(Time now) const;

  // --- in numbers

  WireSet carrying() const { return carrying_; }
  WireState state(std::size_t index) const;
  bool busy(std::size_t index, Time now) const { return now < wires_[index].busy_until; }
  const std::string& board_id(std::size_t index) const { return wires_[index].board_id; }
  const PacketCounters& packets(std::size_t index) const {
    return wires_[index].tracker.counters();
  }
  std::uint64_t copies(std::size_t index) const { return wires_[index].copies; }
  Time round_trip(std::size_t index) const { return wires_[index].round_trip; }
  // Time{0}: never.
  Time heard_at(std::size_t index) const { return wires_[index].heard; }
  // Of the session: lost is what no wire has brought, a duplicate what another has brought first.
  const PacketCounters& counters() const { return counters_; }

 private:
  struct Wire {
    bool up = false;
    bool can_ask = true;
    bool known = false;       // its board is the session's
    bool other = false;       // it is not
    bool connecting = false;  // said so last
    bool has_clock = false;
    std::uint32_t boot = 0;
    std::uint32_t board_ms = 0;  // the board's T at clock_ms
    std::uint32_t clock_ms = 0;
    std::uint32_t gap = 0;     // before the datagram that is looked at
    std::uint32_t others = 0;  // that others brought first since its newest one
    Time heard{0};
    Time ask_at{0};
    Time asked_at{0};
    Time busy_until{0};
    std::uint32_t busy_ms = 0;  // the board's T of the newest BUSY
    Time round_trip{0};
    std::uint64_t copies = 0;
    PacketTracker tracker;
    IdentityQuestion question{Time{0}};
    Lease lease;
    std::string board_id;
  };

  static constexpr Time ask_interval = std::chrono::milliseconds{100};
  static constexpr Time ask_other_interval = std::chrono::seconds{1};
  static constexpr Time patience = std::chrono::milliseconds{300};
  // As that of a role (host_role.hpp).
  static constexpr Time busy_memory = std::chrono::milliseconds{300};
  // An older state is not compared with: the board's T wraps.
  static constexpr Time own_state_memory = std::chrono::hours{1};
  static Time timeout_of(LinkTiming timing) { return std::chrono::milliseconds{timing.timeout_ms}; }

  WireSet known() const;
  bool is_heard(const Wire& wire, Time now) const {
    return wire.known && wire.heard.count() != 0 && now - wire.heard < timeout_;
  }
  static bool in_clock(const Wire& wire, std::uint32_t t_ms, Time now);
  bool fits_others(const Wire& wire, std::uint32_t t_ms, Time now) const;
  static void set_clock(Wire& wire, std::uint32_t t_ms, Time now);
  static void ask_soon(Wire& wire, Time now);
  bool admits(Wire& wire, std::uint32_t t_ms, Time now) const;
  bool agrees(const Wire& wire, std::uint32_t t_ms, bool fits, Time now) const;
  void compare_those_that_listen(std::uint32_t t_ms, Time now);
  void turn_away(Wire& wire, Time now);
  bool all_connecting(Time now) const;
  bool others_carry(const Wire& wire, Time now) const;
  bool refuses(const Wire& wire, Time now) const;
  void look(Time now);

  std::vector<Wire> wires_;
  Time timeout_;
  bool has_id_ = false;
  std::string id_;  // of the session's board
  bool begun_ = false;
  bool anew_ = true;  // nothing has come since all wires were down
  Time first_answer_{0};
  std::uint32_t boot_ = 0;
  Time proven_{0};  // when the newest proof of the boot came
  WireSet carrying_ = 0;
  Time own_state_at_{0};
  std::uint32_t own_state_ms_ = 0;
  PacketCounters counters_;
};

}  // namespace r4
