// SPDX-License-Identifier: GPL-3.0-or-later
// What this host is to its board. Without I/O, part of a session.
//
//                        CMD names a command of this session
//     asking ----------------------------------------------------> controlling
//      ^  |                                                          |     |
//      |  +--BUSY--> refused <-----------------BUSY------------------+     |
//      |               |                                                   |
//      |  300 ms after the last BUSY                      the link goes down
//      +---------------+---------------------------------------------------+
//
//     (If the board's times show that CMD is newer than each BUSY, refused leads to controlling.)
//
//     asking       nothing shows yet that the board obeys this host
//     refused      the board has answered BUSY: another host controls it
//     controlling  the board has executed a command of this session since the link came up
#pragma once

#include "../measurement/time.hpp"

namespace r4 {

class HostRoleMachine {
 public:
  // The board has answered BUSY, or a transport hears another host in this host's place on a bus.
  void on_busy_until(Time until) {
    controlling_ = false;
    refused_until_ = until;
  }
  // CMD names a command of this session; the link is up. `later`: CMD is newer than each BUSY.
  void on_own_command(bool later, Time now) {
    if (!later && refused(now)) return;
    controlling_ = true;
    refused_until_ = Time{0};
  }
  // Whether the link is up now.
  void on_link(bool up) { controlling_ = controlling_ && up; }

  bool controlling() const { return controlling_; }
  bool refused(Time now) const { return now < refused_until_; }
  Time refused_until() const { return refused_until_; }

 private:
  bool controlling_ = false;
  Time refused_until_{0};  // later than now only if not controlling
};

}  // namespace r4
