// SPDX-License-Identifier: GPL-3.0-or-later
// The values that a program may give for options and times, in one place. What is outside them throws
// Error{usage} with the name, the value and the range: a -1 that became 49 days would keep motors on.
#pragma once

#include <chrono>
#include <cstdint>
#include <string_view>

namespace r4 {

enum class BoardRole : std::uint8_t;
struct Command;
class Setpoints;
struct SessionOptions;

// SessionOptions and what is in them; the constructors of the boards and of Session call it.
void require_valid(const SessionOptions& options);

// A program that only watches stops its board, asks who it is, and commands nothing else.
void require_control(BoardRole role, std::string_view what);
void require_control(BoardRole role, const Command& command);
void require_control(BoardRole role, const Setpoints& group);

// The time in which a command is to be confirmed, or something is to come: more than none. A stop has
// no such limit: it goes out whatever its timeout.
void require_timeout(std::string_view what, std::chrono::milliseconds timeout);

// The time to wait for something that may be there already: 0 only looks.
void require_wait(std::string_view what, std::chrono::milliseconds timeout);

// The period of the application watchdog: up to an hour; 0 turns it off.
void require_watchdog(std::chrono::milliseconds period);
// The time that a callback has: up to an hour; 0 for any.
void require_callback_limit(std::chrono::milliseconds limit);

// The board's timeout and heartbeat interval, set together, by a host that sends heartbeats every
// `ours`: two of them must come in each timeout.
void require_link_timing(std::chrono::milliseconds timeout, std::chrono::milliseconds heartbeat,
                         std::chrono::milliseconds ours);

}  // namespace r4
