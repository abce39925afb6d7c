// SPDX-License-Identifier: GPL-3.0-or-later
// The role of this host at its board. A part of a session, without I/O.
//                        CMD names a command of this session
//     asking ----------------------------------------------------> controlling
//      ^  |                                                          |     |
//      |  +--BUSY--> refused <-----------------BUSY------------------+     |
//      |               |                                                   |
//      |  300 ms after the last BUSY                      the link goes down
//      +---------------+---------------------------------------------------+
//
//     asking       no proof that the board obeys this host
//     refused      the board has answered BUSY: another host controls it. Leads to controlling if
//                  the board's T shows that CMD is newer than each BUSY
//     controlling  the board has executed a command of this session since the link came up
#pragma once

#include "../measurement/time.hpp"

namespace r4 {

class HostRoleMachine {
 public:
  // The board has answered BUSY, or another host uses this host's ids on a bus.
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
  void on_link(bool up) { controlling_ = controlling_ && up; }

  bool controlling() const { return controlling_; }
  bool refused(Time now) const { return now < refused_until_; }
  Time refused_until() const { return refused_until_; }

 private:
  bool controlling_ = false;
  Time refused_until_{0};  // only if not controlling
};

}  // namespace r4
