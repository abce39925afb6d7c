// SPDX-License-Identifier: GPL-3.0-or-later
// The board's end of the link: which host controls the board, whether that host is alive, and which of
// its commands may be executed (paper section 4.3; docs/protocol.md "The link", docs/safety.md).
//
//                 heartbeat that may begin a session         the host is silent for the timeout,
//     CONNECTING ------------------------------> ACTIVE ----- says farewell, or its paths are gone -+
//       (boot)                                     ^                                                v
//                                                  +---- heartbeat that may begin or resume ------ LOST
//
// There are two kinds of host:
//
//     a host with a session id (SID)   each heartbeat must echo the T of a board heartbeat that was sent
//                                      at most `timeout` ago, and in LOST since the link was lost
//     a paper host (no SID)            is known by where it is. If its T was an echo once, it must go on
//                                      echoing; else its T is a clock of its own, and its heartbeats
//                                      count when they arrive. It never resumes: in LOST nothing shows
//                                      that it is the same host
//
// All times are the board's clock in ms, which wraps; it must start at a random value at boot.
#pragma once

#include <cstdint>

#include "../datagram/wrapping.hpp"
#include "r4link/messages/packet_tracker.hpp"
#include "r4link/vocabulary.hpp"

namespace r4 {

// Where a datagram came from and where its answer goes: a port of the board and, on it, a peer.
struct Source {
  std::uint8_t port = 0;
  std::uint32_t peer = 0;
  friend bool operator==(Source a, Source b) { return a.port == b.port && a.peer == b.peer; }
  friend bool operator!=(Source a, Source b) { return !(a == b); }
};

// The host that sent a datagram: by its session id, or by where it is if it has none (a paper host).
struct HostId {
  Source from;
  SessionId sid = no_session;
  friend bool operator==(HostId a, HostId b) {
    return a.sid == b.sid && (a.sid != no_session || a.from == b.from);
  }
  friend bool operator!=(HostId a, HostId b) { return !(a == b); }
};

enum class BoardLinkState : std::uint8_t { connecting, active, lost };

// What a host's heartbeat did.
enum class HeartbeatEffect : std::uint8_t {
  fed,          // the controlling host is alive
  repeated,     // its path is alive; another one has brought that heartbeat before, or a newer one
  resumed,      // LOST -> ACTIVE, the same session goes on
  new_session,  // the sender controls the board now; nothing of an earlier host may be restored
  stale,        // no effect: no echo or an old one, overtaken, or read too late
  unheard,  // the same, and its host may have no fresh T: answer it with a heartbeat that it can echo
  busy,     // another host controls the board
};

class BoardLink {
 public:
  struct Timing {
    std::uint32_t heartbeat_ms = 500;
    std::uint32_t timeout_ms = 1000;
  };

  explicit BoardLink(Timing timing) : timing_(timing) {}
  void set_timing(Timing timing) { timing_ = timing; }

  // A host heartbeat. `pnum` counts only if `has_pnum`; `t` is 0 if it has none. It arrived at most `waited_ms`
  // before it is handed over, and counts from then: one that may have waited for the timeout is stale.
  struct HostHeartbeat {
    HostId host;
    bool has_pnum = false;
    std::uint32_t pnum = 0;
    std::uint64_t t = 0;
    std::uint32_t waited_ms = 0;
  };
  HeartbeatEffect on_heartbeat(const HostHeartbeat& heartbeat, std::uint32_t now_ms);

  // Why this command may not be executed: stale, duplicate, safe, busy, or the code of a refusal that is repeated;
  // none if it may. The number is not spent until executed() or refused() is called.
  Refusal admit(HostId host, std::uint32_t pnum, std::uint32_t now_ms) const;
  // The session's command with this number was carried out: it and all older numbers are spent.
  void executed(std::uint32_t pnum);
  // A command was refused, for its content or the safe state. If it is the session's, it and all older
  // numbers are spent, so that no duplicate of it is executed later. A duplicate of one of the last
  // refused_memory is refused with the same code.
  void refused(HostId host, std::uint32_t pnum, Refusal code);
  // True if this number is one of the next `memory` of the session's.
  bool is_next(std::uint32_t pnum) const;

  // Lets time pass. True once, when the controlling host has been silent for the timeout: ACTIVE -> LOST.
  bool poll(std::uint32_t now_ms);
  // Every path of the session is gone. True if a host was in control: ACTIVE -> LOST.
  bool lose(std::uint32_t now_ms);
  // The session's host has ended it: ACTIVE -> LOST. Its id begins no session any more.
  void leave(std::uint32_t now_ms);

  // The board's own heartbeats: whether one is due, and that one was sent (its T). Besides the regular
  // ones, an echo that stays away is asked for again every echo_retry_ms; entering ACTIVE and LOST
  // each send one at once.
  bool heartbeat_due(std::uint32_t now_ms) const;
  void heartbeat_sent(std::uint32_t t_ms);
  // A heartbeat shows this T, to whomever it is sent: it can be echoed.
  void shown(std::uint32_t t_ms);
  // The next one is wanted at once: it brings news.
  void send_soon() { send_now_ = true; }
  // The T of a heartbeat that answers one peer. Answers within answer_spacing_ms share it, so that hosts
  // which ask often do not push out of the memory what another host is about to echo.
  std::uint32_t answer_time(std::uint32_t t_ms) const;

  // Milliseconds until poll() or heartbeat_due() may have something to say; 0 is now.
  std::uint32_t due_in(std::uint32_t now_ms) const;

  BoardLinkState state() const { return state_; }
  // True while a host controls the board.
  bool has_owner() const { return state_ == BoardLinkState::active; }
  // True if this host controls the board, or did when the link was lost.
  bool is_session_of(HostId host) const { return has_session_ && host == host_; }
  // When the controlling host was last heard alive, or later than that; after the first session began.
  std::uint32_t fed_ms() const { return fed_ms_; }
  // When the link is lost if the host stays silent; only while ACTIVE.
  std::uint32_t deadline_ms() const { return fed_ms_ + timing_.timeout_ms; }
  // The number of the heartbeat with which the session of this host began. A refusal reports it, so that the host
  // knows that every command which it has sent since is remembered. False: it is not this host's session, or its
  // heartbeats have no numbers.
  bool first_heartbeat(HostId host, std::uint32_t& pnum) const;
  // The number of the last command executed in this session (the CMD field); 0 before the first.
  std::uint32_t last_executed() const { return last_executed_; }

  static constexpr std::uint32_t echo_retry_ms = 100;
  static constexpr std::uint32_t answer_spacing_ms = 50;
  // A command that a heartbeat overtook this long ago is stale.
  static constexpr std::uint32_t late_limit_ms = 250;
  // How far ahead of the newest known number a command may be.
  static constexpr std::uint32_t command_window = 65536;
  // How far back it is known which numbers were executed: there DUPLICATE and STALE are exact.
  static constexpr std::uint32_t memory = 64;
  static constexpr int refused_memory = 16;
  // So many sessions that were left are remembered.
  static constexpr int left_memory = 4;

 private:
  enum class Clock : std::uint8_t { unknown, echo, own };  // what a paper host's T turned out to be
  enum class Freshness : std::uint8_t { fresh, stale, no_echo };  // no_echo: none is asked for

  Freshness judge(const HostHeartbeat& heartbeat, std::uint32_t now_ms) const;
  bool is_echo(std::uint64_t t) const;
  bool continues(const HostHeartbeat& heartbeat) const;
  bool has_left(HostId host) const;
  void begin_session(const HostHeartbeat& heartbeat, std::uint32_t at_ms);
  void resume(const HostHeartbeat& heartbeat, std::uint32_t at_ms);
  void feed(const HostHeartbeat& heartbeat, std::uint32_t at_ms);
  void spend(std::uint32_t pnum);
  bool in_window(std::uint32_t pnum) const;
  Refusal code_of_spent(std::uint32_t pnum) const;
  bool lacks_echo() const;

  Timing timing_;
  BoardLinkState state_ = BoardLinkState::connecting;

  // The session: kept while LOST, so that the same host can resume it.
  bool has_session_ = false;
  HostId host_;
  Clock clock_ = Clock::unknown;  // of a paper host
  SessionId left_[left_memory] = {};
  int left_next_ = 0;
  std::uint32_t first_heartbeat_ = 0;
  bool has_baseline_ = false;        // numbers up to newest_ are spent
  std::uint32_t newest_ = 0;         // newest executed command, or the session's first heartbeat
  std::uint64_t executed_bits_ = 0;  // bit i: newest_ - i was executed
  std::uint32_t refused_[refused_memory] = {};
  Refusal refused_codes_[refused_memory] = {};
  int refused_used_ = 0;
  int refused_next_ = 0;
  std::uint32_t last_executed_ = 0;
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

  // The T of the board's own heartbeats, to recognise their echoes.
  static constexpr int sent_count = 64;
  std::uint32_t sent_[sent_count] = {};
  int sent_used_ = 0;
  int sent_next_ = 0;
  bool any_sent_ = false;
  std::uint32_t last_sent_ms_ = 0;
  std::uint32_t lost_ms_ = 0;  // when LOST was entered
  bool send_now_ = true;       // boot, ACTIVE and LOST entered
};

}  // namespace r4
