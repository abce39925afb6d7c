// SPDX-License-Identifier: GPL-3.0-or-later
// The ranges of a program's options and times. A value outside its range throws Error{usage} with
// the name, the value and the range: a -1 read as 49 days would keep motors on.
#pragma once

#include <chrono>
#include <cstdint>
#include <string_view>

namespace r4 {

enum class BoardRole : std::uint8_t;
struct Command;
class Setpoints;
struct SessionOptions;

void require_valid(const SessionOptions& options);

// A watcher may send only a stop, Q:ID and Q:WIRING. For other commands these functions throw
// Error.
void require_control(BoardRole role, std::string_view what);
void require_control(BoardRole role, const Command& command);
void require_control(BoardRole role, const Setpoints& group);

// The timeout of a command must be longer than 0 ms. A stop is sent with any timeout.
void require_timeout(std::string_view what, std::chrono::milliseconds timeout);

// A time to wait may be 0.
void require_wait(std::string_view what, std::chrono::milliseconds timeout);

// Up to an hour; 0: off.
void require_watchdog(std::chrono::milliseconds period);
// Up to an hour; 0: no limit.
void require_callback_limit(std::chrono::milliseconds limit);

// `ours`: the period of this host's heartbeats. Two periods must fit into the board's timeout.
void require_link_timing(std::chrono::milliseconds timeout, std::chrono::milliseconds heartbeat,
                         std::chrono::milliseconds ours);

}  // namespace r4
