// SPDX-License-Identifier: GPL-3.0-or-later
// Boards and their host on one CAN bus in virtual time, with the traffic of a working machine. Each
// board sends states and heartbeats. The host sends heartbeats and commands to each board. Ids,
// ISO-TP and packed form are as on a real CAN link. The values change as in a machine that drives.
#pragma once

#include <cstdint>

#include "r4link/state.hpp"
#include "tests/support/can_bus_model.hpp"

namespace r4::test {

struct BackboneOptions {
  int boards = 8;
  CanBusOptions bus;
  bool packed = true;
  FieldSet fields = FieldSet::paper_default();
  std::uint8_t tx_dl = 8;  // more than 8: FD
  std::uint32_t states_hz = 100;
  std::uint32_t board_heartbeats_hz = 2;
  std::uint32_t host_heartbeats_hz = 10;
  std::uint32_t commands_hz = 20;
  // true: all streams send at the same time (the worst case); false: at random phases
  bool in_step = false;
  std::uint32_t reaction_us = 20;  // from the end of a frame to the answer in the controller
  std::uint32_t seconds = 10;
};

struct Flow {
  std::uint32_t sent = 0;         // datagrams due
  std::uint32_t delivered = 0;    // datagrams that arrived unchanged
  std::uint32_t replaced = 0;     // states that a newer state replaced before they were sent
  std::uint32_t max_late_us = 0;  // from the time when a datagram was due to its arrival
  std::uint32_t bytes = 0;        // size of all datagrams, as sent on the bus
  std::uint32_t lost() const { return sent - delivered - replaced; }
};

struct BackboneResult {
  double load = 0;  // over the seconds in the options
  double frames_per_second = 0;
  Flow telemetry;  // states and heartbeats of boards
  Flow commands;   // heartbeats and commands to boards
  std::uint32_t isotp_errors = 0;
  std::uint32_t max_silence_us = 0;  // longest time without a host heartbeat at any board
};

BackboneResult run_backbone(const BackboneOptions& options);

}  // namespace r4::test
