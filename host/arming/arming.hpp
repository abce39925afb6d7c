// SPDX-License-Identifier: GPL-3.0-or-later
// Whether a program may drive outputs, and how it comes to be allowed: without I/O, part of a session.
//
// Whatever made the outputs safe may be over by itself (a handle held again, an obstacle gone, a board
// that has restarted) or by somebody else's E:CLEAR. A program that streams setpoints would then drive
// off, unasked. So output commands are refused here until the program calls arm(), on purpose:
//
//     cause_      any -------------- R:1,On of an arm() is confirmed ------------> none: armed
//                  ^                                                                 |
//                  +-- a cause other than the link; a restart; relay 1 seen open ----+
//
//     attempt_    none --arm()--> begun --the link is up--> clearing --no cause is left--> closing
//                  ^                                        |  ^  | E:CLEAR of a stop,        |
//                  |                                        |  +--+ watchdog, fault           |
//                  +----------------------------------------+---------------------------------+
//                   a cause that cannot be cleared, or is new; the deadline; R:1,On confirmed
//
// A lost link does not disarm: whether the board brings its outputs back (`recovery`) is seen by relay 1,
// the motor supply (docs/safety.md), which every state tells.
//
// arm() clears what it finds when it begins, and what that was hiding, each cause once: a stop that is
// pressed meanwhile stays, and ends it. A released handle and an obstacle cannot be cleared, and end it.
//
// arm() never clears a stop, a watchdog or a fault that may be older than the session: a program
// that a supervisor restarts would drive off again by itself. A cause may be older until the board,
// under our control, was heard without it.
#pragma once

#include <cstdint>

#include "r4link/link.hpp"

namespace r4 {

// The cause that a reason of the board is; none for `none` and `link`.
DisarmCause cause_of(SafeReason reason);
// The same of a stop, a watchdog or a fault that may be older than the session.
DisarmCause earlier_cause_of(SafeReason reason);

class ArmingMachine {
 public:
  // What arm() needs next.
  enum class Step : std::uint8_t {
    wait,   // for the link
    clear,  // E:CLEAR
    close,  // R:1,On
    fail,   // it cannot be armed: cause()
  };

  bool armed() const { return cause_ == DisarmCause::none; }
  DisarmCause cause() const { return cause_; }

  // --- what disarms

  void disarm(DisarmCause cause);
  // The board's reason to be safe, as heard last.
  void on_reason(SafeReason reason);
  // The board, under our control, tells that reason.
  void on_heard(SafeReason reason);
  // This computer slept: a session begins, which has seen nothing yet.
  void on_sleep();
  // The link is not up.
  void on_outage() { outage_ = true; }
  // A state of a board that has no reason to be safe tells how relay 1 is.
  void on_supply(bool closed);

  // --- arm()

  void begin();
  bool under_way() const { return attempt_ != Attempt::none; }
  // It ends without success.
  void give_up() { attempt_ = Attempt::none; }
  // `reason`: the board's, as heard last.
  Step next(SafeReason reason);
  // R:1,On is confirmed, and nothing speaks against it.
  void on_closed();

 private:
  // `begun`: the board's reason has not been looked at yet.
  enum class Attempt : std::uint8_t { none, begun, clearing, closing };

  static std::uint8_t bit(SafeReason reason) {
    return static_cast<std::uint8_t>(1U << static_cast<unsigned>(reason));
  }
  Step fail(DisarmCause cause);

  DisarmCause cause_ = DisarmCause::not_yet;
  bool outage_ = false;  // since relay 1 was last known to be closed
  Attempt attempt_ = Attempt::none;
  std::uint8_t cleared_ = 0;     // bit n: this arm() has cleared reason n
  std::uint8_t earlier_ = 0xFF;  // bit n: reason n may be older than the session
};

}  // namespace r4
