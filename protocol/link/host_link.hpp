// SPDX-License-Identifier: GPL-3.0-or-later
// The host's end of the link (paper section 4.3; docs/reference/protocol.md "The link").
//     connecting --> active <--> safe        active, safe --> lost --> active, safe, connecting
//
//     connecting  no datagram received yet, or the board is booting (it sends `PNum:0;T:0`)
//     active      the board streams its state and reports no reason to be safe
//     safe        the board reports a reason
//     lost        no valid datagram from the board for the timeout
//
// Times are the host's clock in ms, which wraps.
#pragma once

#include <cstdint>

#include "../datagram/wrapping.hpp"
#include "r4link/vocabulary.hpp"

namespace r4 {

class HostLink {
 public:
  // `first_pnum` is random, so that the CMD of another host's command confirms no command.
  HostLink(LinkTiming timing, std::uint32_t first_pnum)
      : timing_(timing), first_pnum_(first_pnum), next_pnum_(first_pnum) {}

  // The session's id. While wants_session(), do not send; begin_session() takes a new random id.
  SessionId session() const { return session_; }
  bool wants_session() const { return session_ == no_session; }
  void begin_session(SessionId id) { session_ = id; }
  // Ends control, or requests control again, with a new session.
  void leave_session() {
    end_session();
    forget_boot();
    answer_now_ = true;
  }

  // --- the board's datagrams, without duplicates and late ones (host/paths/paths.hpp).

  // A heartbeat, which heartbeat_due() answers at once. `t_ms`: its T, not older than echo().
  void on_heartbeat(std::uint32_t t_ms);
  // The field SAFE of the newest state or heartbeat; none if the field is missing.
  void on_reason(SafeReason reason, std::uint32_t now_ms);
  void on_heard(std::uint32_t now_ms);
  // The board reports that it is booting, so it has no session.
  void on_booting(SafeReason reason, std::uint32_t now_ms);
  // The board restarted, or the host's clock stood still. Without on_booting() the session ends.
  void on_restart();

  // The host's machine slept: the board counts as restarted, and a new session is needed.
  void begin_anew();

  // If the transport is down, the link is lost at once. If it is up, a heartbeat is due at once.
  void on_transport(bool up);

  // Checks for silence of the board. True if the state changed.
  bool poll(std::uint32_t now_ms);

  // True if a heartbeat should be sent at `now_ms`. False while heartbeats are gated.
  bool heartbeat_due(std::uint32_t now_ms) const;
  void heartbeat_sent(std::uint32_t now_ms);
  // Call after heartbeat_sent() if sending failed: the heartbeat is due again after retry_ms.
  void heartbeat_not_sent(std::uint32_t now_ms);
  // The T for the next heartbeat: the T of the board's newest heartbeat, 0 before the first.
  std::uint32_t echo() const { return echo_; }

  // If feed() is not called for `period_ms`, heartbeats stop until the next call. 0: off.
  void watchdog(std::uint32_t period_ms, std::uint32_t now_ms);
  void feed(std::uint32_t now_ms);
  bool watchdog_expired(std::uint32_t now_ms) const {
    return watchdog_ms_ != 0 && (hung_ || now_ms - fed_ms_ > watchdog_ms_);
  }
  // hold(true) stops the heartbeats for a reason other than the watchdog, until hold(false).
  void hold(bool held) { held_ = held; }
  bool gated(std::uint32_t now_ms) const { return held_ || watchdog_expired(now_ms); }

  std::uint32_t take_pnum() { return next_pnum_++; }
  std::uint32_t last_pnum() const { return next_pnum_ - 1; }
  bool is_taken(std::uint32_t pnum) const { return pnum - first_pnum_ < next_pnum_ - first_pnum_; }

  // Milliseconds until poll() or heartbeat_due() may return true; 0 is now.
  std::uint32_t due_in(std::uint32_t now_ms) const;

  HostLinkState state() const { return state_; }
  // True if the host has echoed a T of this boot. Before, the board executes no command.
  bool echoed() const { return echoed_; }
  std::uint32_t restarts() const { return restarts_; }
  SafeReason reason() const { return reason_; }
  // True after 12 days of silence: the board's T may have wrapped, so begin_anew() is needed.
  bool long_silent(std::uint32_t now_ms) const { return heard_ && now_ms - heard_ms_ > long_ago; }

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
  bool booting_ = false;  // the newest report was of a booting board
  std::uint32_t restarts_ = 0;
  std::uint32_t sent_ms_ = 0;
  bool any_sent_ = false;
  bool answer_now_ = true;
  bool echoed_ = false;
  bool echoed_before_ = false;  // echoed_ before the newest heartbeat
  std::uint32_t watchdog_ms_ = 0;
  std::uint32_t fed_ms_ = 0;
  bool hung_ = false;  // expired at a poll(); stays set when the clock wraps
  bool held_ = false;
};

}  // namespace r4
