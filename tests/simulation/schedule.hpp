// SPDX-License-Identifier: GPL-3.0-or-later
// The scenario of one seed: the faults of the channel, and the events with their times.
#pragma once

#include <cstdint>
#include <vector>

#include "protocol/messages/settings.hpp"
#include "random.hpp"

namespace r4::simulation {

struct ChannelFaults {
  double loss = 0;
  double duplicate = 0;
  double corrupt = 0;
  std::uint32_t delay_us = 500;  // delay of every datagram
  std::uint32_t jitter_us = 0;   // random uniform extra delay, which changes the order
  double straggle = 0;           // the share of datagrams with the long delay straggle_us
  std::uint32_t straggle_us = 0;
};

struct Happening {
  enum class Kind : std::uint8_t {
    cut,           // all datagrams are lost in both directions for `length_us`
    cut_to_board,  // datagrams from host to board are lost
    cut_to_host,
    host_restart,  // the host process is killed and restarts after `length_us`
    host_freeze,   // the application hangs, so its watchdog stops the heartbeats for `length_us`
    board_restart,
    port_down,  // the board's port reports that its transport is lost
    stop,       // the host sends an emergency stop, and clears it after `length_us`
    handle,     // the dead-man's handle is released for `length_us`
    obstacle,   // sensor 1 sees an obstacle for `length_us`
    address,    // the host's datagrams come from another address, permanently or for `length_us`
    // another process sends an emergency stop and ends, after `length_us` at the latest
    stopper,
    leave,          // the host process sends a farewell, ends, and restarts after `length_us`
    watch,          // a program watches for `length_us`; `host` is its number
    watcher_stops,  // a watcher sends an emergency stop
    // The host's end of a path is disconnected for `length_us`, and the system reports the change.
    // If each path has its own port, the board's port is also disconnected.
    unplug,
    stall,  // datagrams sent on a path wait until `length_us` has passed
  };
  Kind kind;
  std::uint64_t at_us;
  std::uint64_t length_us;
  int host;
  // Bit w: a happening of paths affects path w. An unplug affects only the lowest of these paths.
  std::uint8_t paths = 0xFF;
};

struct PathFaults {
  ChannelFaults to_board, to_host;
};

// The board's loop does not run for this time. Arriving datagrams wait.
struct Standstill {
  std::uint64_t at_us;
  std::uint64_t length_us;
};

struct Schedule {
  std::uint64_t duration_us = 0;
  int hosts = 1;              // the second host disturbs the first host
  bool shared_place = false;  // the stopper is the same peer as the first host, as on a CAN bus
  Settings settings;
  ChannelFaults to_board, to_host;  // faults of the first path
  std::vector<PathFaults> more_paths;
  // true: all paths are peers at one port of the board; false: each path has its own port
  bool one_port = false;
  // An hour before the scenario, the first host controlled the board for a second. This path
  // replays the datagrams of that second in both directions. -1: no path replays datagrams.
  int replaying_path = -1;
  bool reboots_after_capture = false;
  int attacked_path = 0;
  // A stranger (stranger.hpp) on the attacked path sends about this often while a host is in
  // control. At other times the stranger sends only the share `stranger_claims`. 0: no stranger.
  std::uint32_t stranger_interval_us = 0;
  double stranger_claims = 0;
  std::vector<Happening> happenings;
  std::vector<Standstill> standstills;  // in the order of time
  std::uint32_t command_interval_us = 0;
  std::uint32_t command_timeout_us = 0;
  double post_share = 0;                // share of commands sent without a confirmation
  double group_share = 0;               // share of groups, with the same target for all steppers
  std::uint32_t board_lateness_us = 0;  // the board's loop runs up to this much late
  // How much faster the board's clock is than the clocks of the hosts. Negative: slower.
  std::int64_t board_drift_ppm = 0;
  static constexpr std::int64_t most_drift_ppm = 100;
  // With an attacker the board has a key for each host. The attacker acts about this often. 0: no
  // attacker and no keys.
  std::uint32_t attack_interval_us = 0;
  bool keys = false;  // keys without an attacker
  int watchers = 0;
  // A program requests leases in the name of other programs about this often. 0: no such program.
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
