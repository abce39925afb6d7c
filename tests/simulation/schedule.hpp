// SPDX-License-Identifier: GPL-3.0-or-later
// The scenario of one seed: the faults of the channel, and the events with their times.
#pragma once

#include <cstdint>
#include <vector>

#include "protocol/messages/settings.hpp"
#include "random.hpp"

namespace r4::simulation {

// The faults of one direction of the channel.
struct ChannelFaults {
  double loss = 0;
  double duplicate = 0;
  double corrupt = 0;
  std::uint32_t delay_us = 500;  // of every datagram
  std::uint32_t jitter_us = 0;   // added at random, uniform: changes the order
  double straggle = 0;           // the share of datagrams that are delayed far longer
  std::uint32_t straggle_us = 0;
};

// An event at a time of the scenario.
struct Happening {
  enum class Kind : std::uint8_t {
    cut,           // loses everything in both directions for `length_us`
    cut_to_board,  // … from host to board only
    cut_to_host,
    host_restart,  // the host process dies and comes back after `length_us`
    host_freeze,   // the application hangs: its watchdog stops the heartbeats for `length_us`
    board_restart,
    port_down,  // the board's port reports that its transport is lost
    stop,       // the host asks for an emergency stop, and clears it after `length_us`
    handle,     // the dead-man's handle is released for `length_us`
    obstacle,   // an obstacle is before sensor 1 for `length_us`
    address,    // the host's datagrams come from another address, permanently or for `length_us`
    // another process asks for an emergency stop and ends, after `length_us` at the latest
    stopper,
    leave,          // the host process sends a farewell and ends; it comes back after `length_us`
    watch,          // a program watches for `length_us`; `host` is its number
    watcher_stops,  // … and asks for an emergency stop
    // The host's end of a path is gone for `length_us`, and the system reports that. The board's
    // port is gone with it if each path has one.
    unplug,
    stall,  // datagrams sent on a path wait until `length_us` are over
  };
  Kind kind;
  std::uint64_t at_us;
  std::uint64_t length_us;
  int host;
  // Bit w: a happening of paths hits path w. An unplug hits the lowest of these paths.
  std::uint8_t paths = 0xFF;
};

// The two directions of a path.
struct PathFaults {
  ChannelFaults to_board, to_host;
};

// The board's loop does nothing for this time; datagrams that arrive wait.
struct Standstill {
  std::uint64_t at_us;
  std::uint64_t length_us;
};

struct Schedule {
  std::uint64_t duration_us = 0;
  int hosts = 1;              // the second host disturbs the first
  bool shared_place = false;  // the stopper has the first host's place, as on a CAN bus
  Settings settings;
  ChannelFaults to_board, to_host;  // of the first path
  std::vector<PathFaults> more_paths;
  // true: all paths are places at one port of the board; false: each has its own port
  bool one_port = false;
  // Before the scenario, an hour ago, the first host had the board for a second: this path replays
  // the datagrams of that second, in both directions. -1: no path does.
  int replaying_path = -1;
  bool reboots_after_capture = false;
  int attacked_path = 0;
  // A stranger (stranger.hpp) on the attacked path sends about this often while a host is in
  // control, and at other times only the share below of these times; 0: there is no stranger.
  std::uint32_t stranger_interval_us = 0;
  double stranger_claims = 0;  // this share
  std::vector<Happening> happenings;
  std::vector<Standstill> standstills;  // in the order of time
  std::uint32_t command_interval_us = 0;
  std::uint32_t command_timeout_us = 0;
  double post_share = 0;   // of commands sent without a confirmation
  double group_share = 0;  // of commands that are a group: the same target for all steppers
  std::uint32_t board_lateness_us = 0;  // the board's loop runs up to this much late
  // The board's clock is faster or slower than the clocks of the hosts.
  std::int64_t board_drift_ppm = 0;
  static constexpr std::int64_t most_drift_ppm = 100;
  // With an attacker the board has a key for each host. The attacker acts about this often; 0: no
  // attacker and no keys.
  std::uint32_t attack_interval_us = 0;
  bool keys = false;  // keys without an attacker
  int watchers = 0;
  // A program asks for leases in the name of other programs about this often; 0: no such program.
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
