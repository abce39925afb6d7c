// SPDX-License-Identifier: GPL-3.0-or-later
// The board's end of the link: which host controls the board, whether the host is alive, and which
// commands may be executed (paper section 4.3; docs/reference/protocol.md "The link", safety.md).
//                 heartbeat that may begin a session      the host is silent for the timeout,
//     CONNECTING ------------------------------> ACTIVE -- leaves, or all its paths are lost ---+
//       (boot)                                     ^                                            v
//                                                  +---- heartbeat that may begin or resume -- LOST
//
//     host with a session id (SID)  Each heartbeat must echo the T of a board heartbeat that is at
//                                   most `timeout` old and, in LOST, was sent after the loss.
//     paper host (no SID)           The source identifies the host. If T was an echo once, it must
//                                   continue to echo. Otherwise T is its own clock, and heartbeats
//                                   count on arrival. It never resumes a session, because in LOST
//                                   nothing proves that it is the same host.
//
// All times are the board's clock in ms, which wraps and must start at a random value at boot.
#pragma once

#include <cstdint>

#include "../datagram/wrapping.hpp"
#include "r4link/messages/packet_tracker.hpp"
#include "r4link/vocabulary.hpp"

namespace r4 {

// The origin of a datagram, to which its answer goes: a port of the board, and a peer on it.
struct Source {
  std::uint8_t port = 0;
  std::uint32_t peer = 0;
  friend bool operator==(Source a, Source b) { return a.port == b.port && a.peer == b.peer; }
  friend bool operator!=(Source a, Source b) { return !(a == b); }
};

// The sender of a datagram: its session id, or its source if it has none (a paper host).
struct HostId {
  Source from;
  SessionId sid = no_session;
  friend bool operator==(HostId a, HostId b) {
    return a.sid == b.sid && (a.sid != no_session || a.from == b.from);
  }
  friend bool operator!=(HostId a, HostId b) { return !(a == b); }
};

enum class BoardLinkState : std::uint8_t { connecting, active, lost };

enum class HeartbeatEffect : std::uint8_t {
  fed,
  repeated,     // the path is alive, but another path delivered this or a newer heartbeat before
  resumed,      // LOST -> ACTIVE, the same session continues
  new_session,  // the sender takes control; setpoints of an earlier host must not be restored
  stale,        // no effect: no echo, an old echo, overtaken, or read too late
  unheard,      // no effect; the host may have no fresh T: answer with a heartbeat that it can echo
  busy,
};

class BoardLink {
 public:
  struct Timing {
    std::uint32_t heartbeat_ms = 500;
    std::uint32_t timeout_ms = 1000;
  };

  explicit BoardLink(Timing timing) : timing_(timing) {}
  void set_timing(Timing timing) { timing_ = timing; }

  // `t`: 0 without a T. The heartbeat arrived at most `waited_ms` before this call, and counts from
  // the earliest possible arrival. A heartbeat that may have waited for the timeout is stale.
  struct HostHeartbeat {
    HostId host;
    bool has_pnum = false;
    std::uint32_t pnum = 0;
    std::uint64_t t = 0;
    std::uint32_t waited_ms = 0;
  };
  HeartbeatEffect on_heartbeat(const HostHeartbeat& heartbeat, std::uint32_t now_ms);

  // The reason not to execute this command: stale, duplicate, safe, busy, or a repeated refusal.
  // Otherwise none. The number is not spent until executed() or refused() is called.
  Refusal admit(HostId host, std::uint32_t pnum, std::uint32_t now_ms) const;
  // The session's command was executed: its number and all older numbers are spent.
  void executed(std::uint32_t pnum);
  // A command was refused because of its content or the safe state. If the session sent the
  // command, its number and all older numbers are spent, so that no duplicate is executed later. A
  // duplicate of one of the last refused_memory refused commands is refused with the same code.
  void refused(HostId host, std::uint32_t pnum, Refusal code);
  // True if this is one of the next `memory` numbers of the session.
  bool is_next(std::uint32_t pnum) const;

  // True once, when the controlling host has been silent for the timeout: ACTIVE -> LOST.
  bool poll(std::uint32_t now_ms);
  // Every path of the session is lost. True if a host was in control: ACTIVE -> LOST.
  bool lose(std::uint32_t now_ms);
  // The host leaves: ACTIVE -> LOST. The last left_memory session ids that left are refused.
  void leave(std::uint32_t now_ms);

  // The board's own heartbeats are due at each interval, every echo_retry_ms while an echo is
  // missing, and at once on entering ACTIVE or LOST. heartbeat_sent() takes the T that was sent.
  bool heartbeat_due(std::uint32_t now_ms) const;
  void heartbeat_sent(std::uint32_t t_ms);
  // A heartbeat with this T was sent to a peer, so the T can be echoed.
  void shown(std::uint32_t t_ms);
  void send_soon() { send_now_ = true; }
  // The T of a heartbeat that answers one peer. Answers within answer_spacing_ms share a T.
  // Otherwise frequent requests would remove from memory a T that another host may echo later.
  std::uint32_t answer_time(std::uint32_t t_ms) const;

  // Milliseconds until poll() or heartbeat_due() may return true; 0 is now.
  std::uint32_t due_in(std::uint32_t now_ms) const;

  BoardLinkState state() const { return state_; }
  bool has_owner() const { return state_ == BoardLinkState::active; }
  // True if this host controls the board, or controlled it when the link was lost.
  bool is_session_of(HostId host) const { return has_session_ && host == host_; }
  // The controlling host was last heard at this time or later. Valid once a session has begun.
  std::uint32_t fed_ms() const { return fed_ms_; }
  // The time at which the link is lost if the host stays silent. Valid only while ACTIVE.
  std::uint32_t deadline_ms() const { return fed_ms_ + timing_.timeout_ms; }
  // The number of the heartbeat that began this host's session: the board remembers all its later
  // commands. False for another host, or if its heartbeats have no numbers.
  bool first_heartbeat(HostId host, std::uint32_t& pnum) const;
  // The number of the last command executed in this session (CMD); 0 before the first.
  std::uint32_t last_executed() const { return last_executed_; }

  static constexpr std::uint32_t echo_retry_ms = 100;
  static constexpr std::uint32_t answer_spacing_ms = 50;
  // A command is stale if a heartbeat overtook it longer ago than this.
  static constexpr std::uint32_t late_limit_ms = 250;
  // The largest distance of a command from the newest known number.
  static constexpr std::uint32_t command_window = 65536;
  // Executed numbers are remembered this far back. Within it, DUPLICATE and STALE are exact.
  static constexpr std::uint32_t memory = 64;
  static constexpr int refused_memory = 16;
  static constexpr int left_memory = 4;

 private:
  enum class Clock : std::uint8_t { unknown, echo, own };         // the meaning of a paper host's T
  enum class Freshness : std::uint8_t { fresh, stale, no_echo };  // no_echo: no echo is required

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

  // Kept while LOST, so that the same host can resume the session.
  bool has_session_ = false;
  HostId host_;
  Clock clock_ = Clock::unknown;
  SessionId left_[left_memory] = {};
  int left_next_ = 0;
  std::uint32_t first_heartbeat_ = 0;
  bool has_baseline_ = false;  // numbers up to newest_ are spent
  std::uint32_t newest_ = 0;
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

  // Heartbeat numbers and their earliest possible arrivals, back to late_limit_ms.
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
  std::uint32_t lost_ms_ = 0;
  bool send_now_ = true;
};

}  // namespace r4
