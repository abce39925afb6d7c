// SPDX-License-Identifier: GPL-3.0-or-later
// The board's settings (`C:key,value`): keys, ranges, defaults (paper section 8.1: 100 Hz state,
// 2 Hz heartbeat, 1 s timeout).
//
//     key        value         default  meaning
//     rate       1-1000        100      state datagrams a second; 1000/rate is rounded down to
//                                       whole milliseconds
//     heartbeat  50-1000       500      ms between the board's heartbeats; below the timeout
//     timeout    100-10000     1000     ms of silence until the safe state; above `heartbeat`
//     recovery   last | rearm  last     outputs after SAFE(link)
//     pack       0 | 1         0        1: on CAN the board sends the packed form
//
// Keys of later capabilities (network, key) are added to the table in settings.cpp.
#pragma once

#include <cstdint>

#include "refusal.hpp"
#include "text.hpp"

namespace r4 {

enum class Recovery : std::uint8_t { last, rearm };

struct Settings {
  std::uint16_t state_rate_hz = 100;
  std::uint16_t heartbeat_ms = 500;
  std::uint16_t timeout_ms = 1000;
  Recovery recovery = Recovery::last;
  bool pack = false;
};

// Changes one setting. Refusal::unknown for a key, ::format for a value that is not of the key's
// kind, ::range outside its range; `settings` only changes on Refusal::none.
Refusal set(Settings& settings, Text key, Text value);

}  // namespace r4
