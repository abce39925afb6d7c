// SPDX-License-Identifier: GPL-3.0-or-later
// Boards and their host on one CAN bus in virtual time, with the traffic of a machine at work: states
// and heartbeats from every board, heartbeats and commands to every board, in the ids, the ISO-TP
// and the form that the link has on CAN. What the datagrams say changes as in a machine that drives.
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
  bool in_step = false;  // all at the same instants: the worst there is; else at any, by the seed
  std::uint32_t reaction_us = 20;  // from a frame's end to the answer in the controller
  std::uint32_t seconds = 10;
};

struct Flow {
  std::uint32_t sent = 0;         // datagrams that should have travelled
  std::uint32_t delivered = 0;    // byte for byte
  std::uint32_t replaced = 0;     // states not yet begun when the next one was due
  std::uint32_t max_late_us = 0;  // from when it was due to when it was there
  std::uint32_t bytes = 0;        // of all of them, as they travelled
  std::uint32_t lost() const { return sent - delivered - replaced; }
};

struct BackboneResult {
  double load = 0;  // over the seconds asked for
  double frames_per_second = 0;
  Flow telemetry;  // states and heartbeats of boards
  Flow commands;   // heartbeats and commands to boards
  std::uint32_t isotp_errors = 0;
  std::uint32_t max_silence_us = 0;  // longest time in which a board heard no host heartbeat
};

BackboneResult run_backbone(const BackboneOptions& options);

}  // namespace r4::test
