// SPDX-License-Identifier: GPL-3.0-or-later
// Whether a program may drive outputs, and the steps of arm(). Without I/O. A safe state may end by
// itself (a handle is held again, an obstacle is removed, a board has restarted), or by another
// program's E:CLEAR. A program that streams setpoints would then drive off without intention. So
// output commands are refused until the program calls arm():
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
// A lost link does not disarm. In every state, relay 1, the motor supply
// (docs/reference/safety.md), shows whether the board restored its outputs (`recovery`). arm()
// clears the first cause that it finds, and each cause that the first cause hid, once. A new stop,
// released handle or obstacle is not cleared, and ends the arm(). A stop, a watchdog or a fault is
// not cleared if it may be older than the session, because a restarted program would drive off. A
// cause is new only after the board was free of it. A fault since the board's start is not cleared.
#pragma once

#include <cstdint>

#include "r4link/link.hpp"

namespace r4 {

class ArmingMachine {
 public:
  enum class Step : std::uint8_t {
    wait,   // wait for the link
    clear,  // E:CLEAR
    close,  // R:1,On
    fail,   // arming is impossible because of cause()
  };

  bool armed() const { return cause_ == DisarmCause::none; }
  DisarmCause cause() const { return cause_; }

  void disarm(DisarmCause cause);
  // The board's newest reason for the safe state. True if the reason ends an arm() that waits for
  // R:1,On: relay 1 must not close when the cause ends.
  bool on_reason(SafeReason reason);
  // The board reports the reason under this session's control.
  void on_heard(SafeReason reason);
  // This computer slept: a new session begins, and any cause may be older than the session.
  void on_sleep();
  void on_outage() { outage_ = true; }
  // Call on_supply() for each state that shows relay 1 while the board is not in the safe state.
  void on_supply(bool closed);

  void begin();
  bool under_way() const { return attempt_ != Attempt::none; }
  void give_up() { attempt_ = Attempt::none; }
  Step next(SafeReason reason);
  // R:1,On is confirmed, and the board's state does not contradict that.
  void on_closed();

 private:
  // `begun`: the board's reason has not been checked.
  enum class Attempt : std::uint8_t { none, begun, clearing, closing };

  Step fail(DisarmCause cause);

  DisarmCause cause_ = DisarmCause::not_yet;
  bool outage_ = false;  // an outage since the last state that shows relay 1
  Attempt attempt_ = Attempt::none;
  std::uint8_t cleared_ = 0;     // bit n: this arm() has cleared reason n
  std::uint8_t earlier_ = 0xFF;  // bit n: reason n may be older than the session or the boot
};

}  // namespace r4
