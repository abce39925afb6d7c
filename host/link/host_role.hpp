// SPDX-License-Identifier: GPL-3.0-or-later
// What this host is to its board: without I/O, part of a session.
//
//              the link comes up         CMD names a command of ours
//     apart -------------------> asking -----------------------------> controlling
//                                ^    |                                     |
//              300 ms after the  |    | BUSY                                | BUSY
//              last BUSY         |    v                                     |
//                                refused <----------------------------------+
//
//     (BUSY leads to refused from apart, too. Where the times of the board show that CMD is its later word,
//     refused leads to controlling)
//
//     apart        the link is down; every state falls back to it when the link goes down, refused
//                  once its time is over
//     asking       the link is up, and nothing shows yet that the board obeys us
//     refused      the board has answered BUSY: another host controls it
//     controlling  the board has executed a command of ours since the link came up
#pragma once

#include <cstdint>

#include "../measurement/time.hpp"

namespace r4 {

enum class HostRole : std::uint8_t { apart, asking, refused, controlling };

class HostRoleMachine {
 public:
  // The board has answered BUSY, or another host's program on our side of the bus has the board.
  void on_busy(Time now) { on_busy_until(now + busy_memory); }
  void on_busy_until(Time until) {
    role_ = HostRole::refused;
    refused_until_ = until;
  }
  // CMD names a command of ours; the link is up. `later`: the board has said so after each BUSY.
  void on_own_command(bool later, Time now) {
    if (later || !refused(now)) role_ = HostRole::controlling;
  }
  // The link, as it is now.
  void on_link(bool up, Time now) {
    if (refused(now)) return;
    if (!up) {
      role_ = HostRole::apart;
    } else if (role_ != HostRole::controlling) {
      role_ = HostRole::asking;
    }
  }

  HostRole role() const { return role_; }
  bool controlling() const { return role_ == HostRole::controlling; }
  bool refused(Time now) const { return role_ == HostRole::refused && now < refused_until_; }
  // When `refused` ends; on_link() is needed then.
  Time refused_until() const { return refused_until_; }

 private:
  // Our heartbeats go out every 100 ms at least, and each is answered.
  static constexpr Time busy_memory = std::chrono::milliseconds{300};
  HostRole role_ = HostRole::apart;
  Time refused_until_{0};
};

}  // namespace r4
