// SPDX-License-Identifier: GPL-3.0-or-later
// The host's end of the link: heartbeats, their gate, and what the host knows of the board
// (paper section 4.3; docs/protocol.md "The link").
//
//     connecting --> active <--> safe        active, safe --> lost --> active, safe, connecting
//
//     connecting  nothing heard yet, or the board sends `PNum:0;T:0`: it is booting
//     active      the board streams its state and reports no reason to be safe
//     safe        the board reports a reason
//     lost        nothing valid from the board for the timeout
//
// Times are the host's clock in ms; it wraps.
#pragma once

#include <cstdint>

#include "../datagram/wrapping.hpp"
#include "r4link/vocabulary.hpp"

namespace r4 {

class HostLink {
 public:
  // `first_pnum` is random, so that the number of a command which another host's session has
  // executed (CMD) is none of ours.
  HostLink(LinkTiming timing, std::uint32_t first_pnum)
      : timing_(timing), first_pnum_(first_pnum), next_pnum_(first_pnum) {}

  // The id of the session. Nothing may be sent while wants_session(): then begin_session() is given
  // a new random one.
  SessionId session() const { return session_; }
  bool wants_session() const { return session_ == no_session; }
  void begin_session(SessionId id) { session_ = id; }

  // --- datagrams of the board. Duplicates and late ones are dropped before (host/paths/paths.hpp).

  // A heartbeat, answered at once by heartbeat_due(). `t_ms`: its T, not older than echo().
  void on_heartbeat(std::uint32_t t_ms);
  // The field SAFE of the newest state or heartbeat; none without that field.
  void on_reason(SafeReason reason, std::uint32_t now_ms);
  // Any datagram of the board.
  void on_heard(std::uint32_t now_ms);
  // The board says that it is booting, so it knows no session.
  void on_booting(SafeReason reason, std::uint32_t now_ms);
  // The board has restarted. Unless it said so itself (on_booting()), a new session is wanted,
  // because the host's own clock may have stood still instead.
  void on_restart();

  // Nothing that is known of the board counts any more, because this computer slept: the board is
  // taken for one that has restarted, and a new session is wanted.
  void begin_anew();

  // The transport has gone (`lost` at once) or come (a heartbeat is due at once).
  void on_transport(bool up);

  // Lets time pass: silence of the board. True if the state changed.
  bool poll(std::uint32_t now_ms);

  // Should a heartbeat be sent now? False while they are gated.
  bool heartbeat_due(std::uint32_t now_ms) const;
  // A heartbeat was sent.
  void heartbeat_sent(std::uint32_t now_ms);
  // It could not be, behind heartbeat_sent(): it is due again soon.
  void heartbeat_not_sent(std::uint32_t now_ms);
  // The T that it carries: the T of the board's newest heartbeat, 0 before the first.
  std::uint32_t echo() const { return echo_; }

  // The application watchdog: heartbeats stop when feed() stays away for `period_ms`, until it is
  // called again; 0 turns it off.
  void watchdog(std::uint32_t period_ms, std::uint32_t now_ms);
  void feed(std::uint32_t now_ms);
  bool watchdog_expired(std::uint32_t now_ms) const {
    return watchdog_ms_ != 0 && (hung_ || now_ms - fed_ms_ > watchdog_ms_);
  }
  // Stops the heartbeats for another reason, until it is called with false.
  void hold(bool held) { held_ = held; }
  bool held() const { return held_; }
  bool gated(std::uint32_t now_ms) const { return held_ || watchdog_expired(now_ms); }

  // The number for the next datagram that the host sends.
  std::uint32_t take_pnum() { return next_pnum_++; }
  // The number that was taken last.
  std::uint32_t last_pnum() const { return next_pnum_ - 1; }
  // True if it was taken in this session.
  bool is_taken(std::uint32_t pnum) const { return pnum - first_pnum_ < next_pnum_ - first_pnum_; }

  // Milliseconds until poll() or heartbeat_due() may have something to say; 0 is now.
  std::uint32_t due_in(std::uint32_t now_ms) const;

  HostLinkState state() const { return state_; }
  // Have we echoed a real T of this boot of the board? It executes no command of ours before.
  bool echoed() const { return echoed_; }
  // How often the board was found to have begun again.
  std::uint32_t restarts() const { return restarts_; }
  SafeReason reason() const { return reason_; }
  // True if the board was silent for 12 days. Then its T has wrapped too far to be compared
  // (datagram/wrapping.hpp), and begin_anew() is needed.
  bool long_silent(std::uint32_t now_ms) const { return heard_ && now_ms - heard_ms_ > long_ago; }

  // From a heartbeat that could not be sent to the next attempt.
  static constexpr std::uint32_t retry_ms = 20;

 private:
  void forget_boot();
  void end_session();

  LinkTiming timing_;
  SessionId session_ = no_session;
  std::uint32_t first_pnum_;
  std::uint32_t next_pnum_;
  HostLinkState state_ = HostLinkState::connecting;
  SafeReason reason_ = SafeReason::none;
  std::uint32_t echo_ = 0;
  std::uint32_t heard_ms_ = 0;
  bool heard_ = false;
  bool booting_ = false;  // it said so last
  std::uint32_t restarts_ = 0;
  std::uint32_t sent_ms_ = 0;
  bool any_sent_ = false;
  bool answer_now_ = true;  // the first heartbeat goes out at once
  bool echoed_ = false;
  bool echoed_before_ = false;  // the heartbeat that was sent last
  std::uint32_t watchdog_ms_ = 0;
  std::uint32_t fed_ms_ = 0;
  bool hung_ = false;  // the watchdog had expired at a poll(): the clock's wrap does not undo it
  bool held_ = false;
};

}  // namespace r4
