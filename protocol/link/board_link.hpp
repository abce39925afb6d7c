// SPDX-License-Identifier: GPL-3.0-or-later
// The board's end of the link: who controls the board, whether that host is alive, and which of its
// commands may be executed (paper section 4.3; docs/protocol.md "The link", docs/safety.md).
//
//                    host heartbeat                     timeout, or owner's transport lost
//     CONNECTING ------------------------> ACTIVE ------------------------------------------+
//         (boot)                             ^            or the owner's farewell           v
//                                            +------------------------------------------- LOST
//                                                fresh host heartbeat
//
// Two kinds of host. An *echo host* numbers from the upper half (PNum >= 2^31) and so declares that
// the T of its heartbeats echoes the T of the board's newest heartbeat: only a fresh echo feeds,
// and commands are executed only after the first echo of a T of this boot (armed), so that nothing
// which a network held back, from before a reboot or an outage, can move a motor. A *paper host*
// numbers from below (or leaves PNum out); its T is an echo if it once was one, else its own clock.
// A session keeps its kind as long as its numbers continue, also where they wrap.
//
// The host may be heard by several wires (session_wires.hpp). Here it has one place, whichever brings it.
//
// All times are the board's clock in ms, which wraps; it must start at a random value at boot.
#pragma once

#include <cstdint>

#include "packet_tracker.hpp"
#include "r4link/vocabulary.hpp"

namespace r4 {

// Where a datagram came from and where its answer goes: a port of the board and, on it, a peer.
struct Source {
  std::uint8_t port = 0;
  std::uint32_t peer = 0;
  friend bool operator==(Source a, Source b) { return a.port == b.port && a.peer == b.peer; }
  friend bool operator!=(Source a, Source b) { return !(a == b); }
};

enum class BoardLinkState : std::uint8_t { connecting, active, lost };

constexpr std::uint32_t echo_host_first_pnum = 0x80000000U;

// What a host's heartbeat did.
enum class HeartbeatEffect : std::uint8_t {
  fed,          // the owner is alive
  resumed,      // LOST -> ACTIVE, the same session goes on
  new_session,  // the sender controls the board now; nothing of an earlier host may be restored
  stale,        // an old echo, overtaken by a newer heartbeat, or read too late: no effect
  busy,         // another host controls the board
};

// What to do with a command.
enum class Admission : std::uint8_t {
  execute,
  refuse,  // answer with the code
  drop,    // count it, no answer: the session is not armed yet
};

class BoardLink {
 public:
  struct Timing {
    std::uint32_t heartbeat_ms = 500;
    std::uint32_t timeout_ms = 1000;
  };

  explicit BoardLink(Timing timing) : timing_(timing) {}
  void set_timing(Timing timing) { timing_ = timing; }

  // A host heartbeat. `pnum` and `t` count only where `has_…` says so. It came at most `waited_ms`
  // before it is handed over, and counts from then: one that may have waited for the timeout is
  // stale.
  struct HostHeartbeat {
    Source from;
    bool has_pnum = false;
    std::uint32_t pnum = 0;
    bool has_time = false;
    std::uint64_t t = 0;
    std::uint32_t waited_ms = 0;
  };
  HeartbeatEffect on_heartbeat(const HostHeartbeat& heartbeat, std::uint32_t now_ms);

  // May this command be executed? On `refuse`, `code` is stale, duplicate, safe or busy. The gate
  // does not move until executed() is called, so a command that is refused for its content stays
  // unexecuted.
  Admission admit(Source from, std::uint32_t pnum, std::uint32_t now_ms, Refusal& code) const;
  // The owner's command with this number was carried out: it and all older ones are spent.
  void executed(std::uint32_t pnum);
  // A command was refused, for its content or the safe state: if it is the session's, it and all
  // older ones are spent, so that no copy of it is executed when the reason is gone. A copy of one of
  // the last refused_memory is refused with the same code.
  void refused(Source from, std::uint32_t pnum, Refusal code);
  // Is this number one of the next `memory` of the session's?
  bool is_next(std::uint32_t pnum) const;
  // Is this admitted command of a host that has begun again? One that does not number its
  // heartbeats shows that only by its first command after an outage. Nothing set before may remain.
  bool begins_anew(std::uint32_t pnum) const;

  // Lets time pass. True once, when the owner has been silent for the timeout: ACTIVE -> LOST.
  bool poll(std::uint32_t now_ms);
  // The transport under `port` is gone. True if that was the owner's: ACTIVE -> LOST.
  bool port_lost(std::uint8_t port, std::uint32_t now_ms);
  // The session's host has another place from now on.
  void move_owner(Source to) { owner_ = to; }

  // The owner says that it ends, by a command that was admitted. Does it say so in this session? It
  // proves that as a heartbeat does: its T must echo one of ours, and one since the session began. The
  // farewell of an earlier session, held back by a network, does not.
  bool may_leave(const HostHeartbeat& farewell, std::uint32_t now_ms) const;
  // It has: ACTIVE -> LOST, and nothing of its session goes on, whoever is heard next.
  void leave(std::uint32_t now_ms);

  // The board's own heartbeats: is one due, and tell when one was sent (its T). Besides the regular
  // ones, an echo that stays away is asked for again every echo_retry_ms; entering ACTIVE and LOST
  // each send one at once.
  bool heartbeat_due(std::uint32_t now_ms) const;
  void heartbeat_sent(std::uint32_t t_ms);
  // Should this stale heartbeat be answered with one of ours? Its sender may have none to echo: it
  // has heard nothing yet, or nothing since we were lost or booted. Seldom enough that two sides
  // which answer each other do not fill the line.
  bool wants_answer(const HostHeartbeat& heartbeat, std::uint32_t now_ms) const;
  // The next one is wanted at once: it brings news.
  void send_soon() { send_now_ = true; }
  // A heartbeat was sent to one peer, besides those above.
  void heartbeat_answered(std::uint32_t t_ms);

  // Milliseconds until poll() or heartbeat_due() may have something to say; 0 is now.
  std::uint32_t due_in(std::uint32_t now_ms) const;

  BoardLinkState state() const { return state_; }
  bool has_owner() const { return state_ == BoardLinkState::active; }
  // … and is it one that may be heard by several wires?
  bool has_echo_host() const { return has_owner() && echo_host_; }
  // The number of the newest heartbeat that fed; only of an echo host.
  std::uint32_t newest_heartbeat() const { return newest_heartbeat_; }
  Source owner() const { return owner_; }
  // Is it the owner, or the one that was when the link was lost?
  bool in_session(Source from) const { return has_session_ && from == owner_; }
  // When the owner was last heard alive: a heartbeat that fed had come then, or later. Only after the
  // first session began.
  std::uint32_t fed_ms() const { return fed_ms_; }
  // When it is lost if it stays silent; only while ACTIVE.
  std::uint32_t deadline_ms() const { return fed_ms_ + timing_.timeout_ms; }
  // With which heartbeat did the session of this host begin to execute commands: the first echo? A
  // refusal tells it, and the host knows by it that what it has sent since is remembered. (Not the
  // heartbeat that began the session: its T:0 may have been on its way since before a reboot.)
  // False: it is not this host's session, it was not echoed yet, or its heartbeats have no numbers.
  bool session_of(Source from, std::uint32_t& first_echo) const;
  // The number of the last command executed in this session (the CMD field); 0 before the first.
  std::uint32_t last_executed() const { return last_executed_; }

  static constexpr std::uint32_t echo_retry_ms = 100;
  static constexpr std::uint32_t answer_spacing_ms = 20;
  // A command that a heartbeat overtook this long ago is stale.
  static constexpr std::uint32_t late_limit_ms = 250;
  // How far ahead of the newest known number a command may be.
  static constexpr std::uint32_t command_window = 65536;
  // The same for a host that comes back after an outage: less, since a restarted host's random first
  // number must not pass for the next of its predecessor's.
  static constexpr std::uint32_t resume_window = 4096;
  // How far back it is known which numbers were executed: there DUPLICATE and STALE are exact.
  static constexpr std::uint32_t memory = 64;
  static constexpr int refused_memory = 16;

 private:
  enum class Clock : std::uint8_t { unknown, echo, own };  // what a paper host's T turned out to be
  enum class Freshness : std::uint8_t { fresh, stale, no_echo };

  Freshness judge(const HostHeartbeat& heartbeat, bool echo_host, std::uint32_t now_ms) const;
  bool sent_at(std::uint32_t t_ms) const;
  bool is_echo(const HostHeartbeat& heartbeat) const;
  bool continues(const HostHeartbeat& heartbeat) const;
  bool is_echo_host(const HostHeartbeat& heartbeat) const;
  HeartbeatEffect begin_session(const HostHeartbeat& heartbeat, bool armed, std::uint32_t waited_ms,
                                std::uint32_t now_ms);
  void feed(const HostHeartbeat& heartbeat, std::uint32_t at_ms);
  void lose(std::uint32_t now_ms);
  void spend(std::uint32_t pnum);
  bool near_newest_heartbeat(std::uint32_t pnum) const;
  bool in_window(std::uint32_t pnum) const;
  Refusal code_of_spent(std::uint32_t pnum) const;
  void remember_sent(std::uint32_t t_ms);

  Timing timing_;
  BoardLinkState state_ = BoardLinkState::connecting;

  // The session: kept while LOST, so that the same host can resume it.
  bool has_session_ = false;
  Source owner_;
  bool echo_host_ = false;
  bool armed_ = false;
  Clock clock_ = Clock::unknown;
  std::uint32_t first_echo_ = 0;  // the number of the heartbeat that armed the session
  std::uint32_t began_ms_ = 0;
  bool has_baseline_ = false;        // numbers up to newest_ are spent
  std::uint32_t newest_ = 0;         // newest executed command, or the session's first heartbeat
  std::uint64_t executed_bits_ = 0;  // bit i: newest_ - i was executed
  std::uint32_t refused_[refused_memory] = {};
  Refusal refused_codes_[refused_memory] = {};
  int refused_used_ = 0;
  int refused_next_ = 0;
  std::uint32_t last_executed_ = 0;
  bool numbers_in_doubt_ = false;  // resumed by a heartbeat without a number
  bool begun_again_ = false;       // the owner has left, or seems to have restarted
  bool has_heartbeat_pnum_ = false;
  std::uint32_t newest_heartbeat_ = 0;
  std::uint32_t newest_echo_ms_ = 0;
  std::uint32_t fed_ms_ = 0;

  // Heartbeat numbers and when they had come at the earliest, as long back as late_limit_ms asks for.
  struct Mark {
    std::uint32_t pnum;
    std::uint32_t at_ms;
  };
  static constexpr int mark_count = 16;
  Mark marks_[mark_count] = {};
  int marks_used_ = 0;

  // The board's own heartbeats, to recognise a paper host's echoes.
  static constexpr int sent_count = 64;
  std::uint32_t sent_[sent_count] = {};
  int sent_used_ = 0;
  int sent_next_ = 0;
  bool any_sent_ = false;
  std::uint32_t last_sent_ms_ = 0;
  bool any_answered_ = false;
  std::uint32_t last_answered_ms_ = 0;
  std::uint32_t lost_ms_ = 0;  // when LOST was entered
  bool send_now_ = true;       // boot, ACTIVE and LOST entered
};

}  // namespace r4
