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

#include "packet_tracker.hpp"
#include "r4link/vocabulary.hpp"

namespace r4 {

class HostLink {
 public:
  // `first_pnum` is random, so that the number of a command which another host's session has executed (CMD) is
  // none of ours.
  HostLink(LinkTiming timing, std::uint32_t first_pnum)
      : timing_(timing), first_pnum_(first_pnum), next_pnum_(first_pnum) {}

  // The id of the session. Nothing may be sent while wants_session(): then begin_session() is given a new random one.
  SessionId session() const { return session_; }
  bool wants_session() const { return session_ == no_session; }
  void begin_session(SessionId id) { session_ = id; }

  // A valid datagram of the board. Returns what its number says; a late, old or duplicate one does
  // not change the state. `heartbeat`: it is a board heartbeat, answered at once by
  // heartbeat_due(). `reason`: its SAFE, none if it carries none.
  Arrival on_datagram(std::uint32_t pnum, std::uint32_t t_ms, bool heartbeat, SafeReason reason,
                      std::uint32_t now_ms);

  // A valid answer of the board to us (N, I): it counts in the packet numbers and shows that the
  // board is there, but says nothing of its state.
  Arrival on_answer(std::uint32_t pnum, std::uint32_t t_ms, std::uint32_t now_ms);

  // --- of a board that is heard over several wires (host/session/wires.hpp). Each has packet numbers of its own, so
  // what is newest is told by T, and who listens to the wires says when the board has begun again.

  // A state or heartbeat of this boot. True if it is the newest so far: what an older one says is no longer so.
  // The echo is the newest of any heartbeat.
  bool on_newest(std::uint32_t t_ms, bool heartbeat, SafeReason reason, std::uint32_t now_ms);
  // The board is there.
  void on_heard(std::uint32_t now_ms) { heard_ms_ = now_ms; }
  // It says that it is booting.
  void on_booting(SafeReason reason, std::uint32_t now_ms);
  // Has the board's T been heard?
  bool knows_clock() const { return board_clock_known_; }
  // May it be of the boot that is known that the board showed T between `since_ms` and now? Any, before the first.
  bool is_of_this_boot(std::uint32_t t_ms, std::uint32_t since_ms, std::uint32_t now_ms,
                       std::int32_t tolerance_ms) const;
  // The board was found to have this T; `restarted`: it has restarted. If it has not said so itself, the host's own
  // clock may have stood still: it wants a new session.
  void on_clock(std::uint32_t t_ms, bool restarted, std::uint32_t now_ms);

  // Nothing that is known of the board counts any more, because this computer slept: the board is
  // taken for one that has restarted, and a new session is wanted.
  void begin_anew();

  // The transport has gone (`lost` at once) or come (a heartbeat is due at once).
  void on_transport(bool up);
  // What comes from now on may have other packet numbers.
  void forget_numbers() {
    if (tracker_.started()) tracker_.restart();
  }

  // Lets time pass: silence of the board. True if the state changed. After 12 days of silence
  // begin_anew() applies, because the times of the two cannot be compared any more
  // (datagram/wrapping.hpp).
  bool poll(std::uint32_t now_ms);

  // Should a heartbeat be sent now? False while they are gated.
  bool heartbeat_due(std::uint32_t now_ms) const;
  // A heartbeat was sent.
  void heartbeat_sent(std::uint32_t now_ms);
  // It could not be: it is due again soon.
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
  const PacketCounters& counters() const { return tracker_.counters(); }

  // A T this far from where the board's clock should be is of another boot.
  static constexpr std::int32_t boot_tolerance_ms = 10000;
  // The same behind `PNum:0;T:0`, which a network may also have held back since the boot before: the
  // paper's boards begin at 0 each time, so their T after a quick restart is not far off.
  static constexpr std::int32_t booting_tolerance_ms = 1000;
  // From a heartbeat that could not be sent to the next attempt.
  static constexpr std::uint32_t retry_ms = 20;

 private:
  void notice_boot(std::uint32_t t_ms, std::uint32_t now_ms);
  void forget_boot();
  void end_session();

  LinkTiming timing_;
  SessionId session_ = no_session;
  std::uint32_t first_pnum_;
  std::uint32_t next_pnum_;
  HostLinkState state_ = HostLinkState::connecting;
  SafeReason reason_ = SafeReason::none;
  PacketTracker tracker_;
  std::uint32_t echo_ = 0;
  std::uint32_t heard_ms_ = 0;
  std::uint32_t board_ms_ = 0;  // the board's T at clock_ms_
  std::uint32_t clock_ms_ = 0;
  bool board_clock_known_ = false;
  bool booting_ = false;         // it said so last
  std::uint32_t newest_ms_ = 0;  // of several wires: the newest T
  bool any_newest_ = false;
  std::uint32_t restarts_ = 0;
  std::uint32_t sent_ms_ = 0;
  bool any_sent_ = false;
  bool answer_now_ = true;  // the first heartbeat goes out at once
  bool echoed_ = false;
  std::uint32_t watchdog_ms_ = 0;
  std::uint32_t fed_ms_ = 0;
  bool hung_ = false;  // the watchdog had expired at a poll(): the clock's wrap does not undo it
  bool held_ = false;
};

}  // namespace r4
