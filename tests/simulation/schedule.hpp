// SPDX-License-Identifier: GPL-3.0-or-later
// One seed's scenario: how bad the channel is and what happens when.
#pragma once

#include <cstdint>
#include <vector>

#include "protocol/messages/settings.hpp"
#include "random.hpp"

namespace r4::simulation {

// What one direction of the channel does to a datagram.
struct ChannelFaults {
  double loss = 0;
  double duplicate = 0;
  double corrupt = 0;
  std::uint32_t delay_us = 500;  // everything
  std::uint32_t jitter_us = 0;   // uniform on top: reorders
  double straggle = 0;           // a few are held back far longer
  std::uint32_t straggle_us = 0;
};

// Something that happens at a time of the scenario.
struct Happening {
  enum class Kind : std::uint8_t {
    cut,           // nothing passes, both ways, for `length_us`
    cut_to_board,  // … host to board only
    cut_to_host,
    host_restart,  // the host process dies and comes back after `length_us`
    host_freeze,   // the application hangs: its watchdog gates the heartbeats for `length_us`
    board_restart,
    port_down,  // the board's port reports its transport lost
    stop,       // the host asks for an emergency stop, and clears it after `length_us`
    handle,     // the dead-man's handle is released for `length_us`
    obstacle,   // something stands before sensor 1 for `length_us`
    address,    // the host's datagrams come from another address, for good or for `length_us`
    stopper,  // another process asks for an emergency stop and goes, after `length_us` at the latest
    leave,    // the host process says farewell and ends; it comes back after `length_us`
    watch,    // a program watches for `length_us`; `host` is the number of it
    watcher_stops,  // … and asks for an emergency stop
    unplug,  // the host's end of a path is gone for `length_us`, which the system tells, and the board's
             // port with it, where each path has one
    stall,  // what is sent on a path waits until `length_us` are over
  };
  Kind kind;
  std::uint64_t at_us;
  std::uint64_t length_us;
  int host;
  // Bit w: it happens to path w, of what happens to paths; an unplug to the lowest of them.
  std::uint8_t paths = 0xFF;
};

// The two directions of a path.
struct PathFaults {
  ChannelFaults to_board, to_host;
};

// The board's loop does nothing for that long: what arrives waits.
struct Standstill {
  std::uint64_t at_us;
  std::uint64_t length_us;
};

struct Schedule {
  std::uint64_t duration_us = 0;
  int hosts = 1;              // the second one meddles
  bool shared_place = false;  // the stopper's place is the first host's, as on a CAN bus
  Settings settings;
  ChannelFaults to_board, to_host;  // of the first path
  std::vector<PathFaults> more_paths;
  bool one_port = false;  // the paths are places at one port of the board; else each has its own
  // Before all this the first host had the board for a second, an hour ago: this path replays what was sent
  // then, both ways. -1: none does.
  int replaying_path = -1;
  bool reboots_after_capture = false;
  int attacked_path = 0;
  // A stranger (stranger.hpp) on the attacked path sends about so often while a host is in control,
  // and else at a share of these times; 0: there is none.
  std::uint32_t stranger_interval_us = 0;
  double stranger_claims = 0;  // that share
  std::vector<Happening> happenings;
  std::vector<Standstill> standstills;  // one after the other
  std::uint32_t command_interval_us = 0;
  std::uint32_t command_timeout_us = 0;
  double post_share = 0;   // commands sent without asking for confirmation
  double group_share = 0;  // commands that are a group: the same target for all steppers
  std::uint32_t board_lateness_us = 0;  // the board's loop comes up to this much late
  // The board's clock is faster, or slower, than the hosts'.
  std::int64_t board_drift_ppm = 0;
  static constexpr std::int64_t most_drift_ppm = 100;
  // The board has a key for each host, and there is an attacker, who acts about so often; 0:
  // neither.
  std::uint32_t attack_interval_us = 0;
  bool keys = false;  // the same without an attacker
  int watchers = 0;
  // Somebody asks for leases in the name of others about so often; 0: nobody.
  std::uint32_t forge_interval_us = 0;

  static Schedule random(Random& random);
  void add_standstills(Random& random);
  void add_watchers(Random& random);
  void add_drift(Random& random);
  void add_paths(Random& random);
  void add_stranger(Random& random);
  int paths() const { return 1 + static_cast<int>(more_paths.size()); }
  const ChannelFaults& faults(int path, bool to_board) const;
};

const char* to_text(Happening::Kind kind);

}  // namespace r4::simulation
