// SPDX-License-Identifier: GPL-3.0-or-later
// A stranger has no key and does not receive any host's datagrams, so it has no session's SID. The
// stranger receives the datagrams that the board sends to watchers and to everyone, and the answers
// to its own datagrams. The stranger's guesses of packet numbers are good.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "random.hpp"

namespace r4::simulation {

class Stranger {
 public:
  static constexpr std::uint32_t address = 0xFFFD;
  // The target of the stranger's stepper commands. No command of a host has this target.
  static constexpr int target = -7777;
  // The field SID of the stranger's own session.
  static constexpr const char* own_name = "SID:00c0ffee00c0ffee;";

  // The board has sent this datagram to the stranger.
  void hears(std::string_view bytes);

  // Returns a datagram of any kind but E:STOP. `next`: the number that the host in control uses
  // next.
  std::string say(Random& random, std::uint32_t next);

  // If the stranger has a number near `next`, returns `next`. Otherwise returns the number after
  // the stranger's newest CMD.
  std::uint32_t guess(std::uint32_t next) const;
  // The T of the newest heartbeat. 0: no heartbeat yet.
  std::uint32_t echo() const { return echo_; }
  // The newest cause that the board has reported.
  std::int32_t cause() const { return cause_; }
  // The token that the stranger must echo for its lease.
  std::uint32_t lease() const { return lease_; }
  // The field SID with which the stranger may pass for the host. Empty if the stranger has received
  // no SID.
  const std::string& name() const { return name_; }

 private:
  static constexpr std::uint32_t most_guesses = 4096;
  std::uint32_t echo_ = 0;
  std::uint32_t lease_ = 0;
  std::uint32_t command_ = 0;  // CMD
  std::int32_t cause_ = 0;
  std::string name_;
  std::uint32_t own_pnum_ = 0x9000'0000U;
};

}  // namespace r4::simulation
