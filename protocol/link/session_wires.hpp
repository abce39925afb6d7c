// SPDX-License-Identifier: GPL-3.0-or-later
// The wires of a session: the places from which its host is heard, and how another becomes one of them
// (docs/protocol.md, 4.9).
//
//                the same heartbeat came, or comes, by a wire of the session
//     stranger ----------------------------------------------------------------> wire of the session
//        ^                                                                         |
//        +------- silent for the timeout, or its port is gone; never the last -----+
//
// An echo host sends every datagram by each of its wires, with the same bytes. Nobody else knows the bytes of
// its heartbeats: their number began at random, and their T echoes the board. So who brings a heartbeat with
// the number and checksum of one that the session's host has sent is that host, or relays it unchanged. What a
// place brings before it has joined feeds nothing.
//
// The host's numbers are counted here, too: over all wires for what is lost, wire by wire for what is repeated.
// All times are the board's clock in ms, which wraps.
#pragma once

#include <cstdint>

#include "board_link.hpp"
#include "packet_tracker.hpp"

namespace r4 {

class SessionWires {
 public:
  static constexpr int most = 4;
  // So many heartbeats of the session's host are remembered.
  static constexpr int remembered = 8;
  // By so many numbers a heartbeat may be ahead of the session's newest: commands, too, have numbers, and a wire
  // may lag by nearly the timeout.
  static constexpr std::uint32_t most_ahead = BoardLink::resume_window;

  // What tells one heartbeat from every other.
  struct Heartbeat {
    std::uint32_t pnum = 0;
    std::uint32_t checksum = 0;
    friend bool operator==(Heartbeat a, Heartbeat b) {
      return a.pnum == b.pnum && a.checksum == b.checksum;
    }
  };

  // A session begins there, with that heartbeat.
  void begin(Source at, Heartbeat heartbeat, std::uint32_t now_ms);
  // It goes on after an outage: each wire has the timeout again until it has to be heard.
  void resume(std::uint32_t now_ms);

  // A heartbeat came by a wire of the session, and the link took it. The places where it came first join.
  void taken(Source at, Heartbeat heartbeat, std::uint32_t timeout_ms, std::uint32_t now_ms);
  // One came by a wire of the session, and had no effect. If it is a copy, that wire is alive.
  void passed_over(Source at, Heartbeat heartbeat, std::uint32_t timeout_ms, std::uint32_t now_ms);

  enum class Stranger : std::uint8_t {
    joined,   // its place is a wire of the session from now on
    waits,    // it may be the host's: wait for a wire of the session to bring it, too
    unknown,  // it is not, or there are four wires
  };
  // A heartbeat came from a place that is no wire of the session. `newest`: the number of the session's
  // newest heartbeat.
  Stranger on_stranger(Source from, Heartbeat heartbeat, std::uint32_t newest,
                       std::uint32_t timeout_ms, std::uint32_t now_ms);

  // Lets time pass while the session is alive: a wire that was silent for the timeout leaves.
  void poll(std::uint32_t timeout_ms, std::uint32_t now_ms);
  // That port is gone, and with it its wires. False: there are no others, or it had none.
  bool port_lost(std::uint8_t port);

  // Counts a number of the host's, which came by a wire of the session. True: it is a copy of what another
  // wire has brought.
  bool count(Source from, std::uint32_t pnum);
  std::uint32_t lost() const { return numbers_.counters().lost; }  // by all wires
  std::uint32_t repeated() const { return repeated_; }             // by one and the same wire

  // A wire that has come or gone since it was asked last. False: none.
  struct Change {
    Source at;
    bool joined = false;
  };
  bool take_change(Change& change);

  bool has(Source at) const { return find(at) >= 0; }
  int size() const { return count_; }  // 0: before the first session
  Source operator[](int i) const { return wires_[i].at; }
  std::uint32_t joins() const { return joins_; }    // since boot, beside the first of each session
  std::uint32_t losses() const { return losses_; }  // since boot, of sessions that went on

 private:
  struct Wire {
    Source at;
    std::uint32_t heard_ms = 0;
    PacketTracker numbers;
  };
  struct Known {
    Heartbeat heartbeat;
    std::uint32_t at_ms = 0;
  };
  struct Candidate {
    Source from;
    Heartbeat heartbeat;
    std::uint32_t at_ms = 0;
    bool waits = false;
  };
  // Each port has places of its own for them, so that what one is flooded with does not matter at another.
  static constexpr int ports = 4;
  static constexpr int candidates_per_port = 2;

  int find(Source at) const;  // -1: none
  bool is_known(Heartbeat heartbeat, std::uint32_t timeout_ms, std::uint32_t now_ms) const;
  void join(Source at, std::uint32_t now_ms);
  void leave(int index);
  void changed(Source at, bool joined);

  Wire wires_[most];
  int count_ = 0;
  Known known_[remembered];
  int known_used_ = 0;
  int known_next_ = 0;
  Candidate candidates_[ports][candidates_per_port];
  Change changes_[most];
  int change_count_ = 0;
  std::uint32_t joins_ = 0;
  std::uint32_t losses_ = 0;
  PacketTracker numbers_;
  std::uint32_t repeated_ = 0;
};

}  // namespace r4
