// SPDX-License-Identifier: GPL-3.0-or-later
// The ranges of a program's options and times. A value outside its range throws Error{usage} with
// the name, the value and the range: a -1 that became 49 days would keep motors on.
#pragma once

#include <chrono>
#include <cstdint>
#include <string_view>

namespace r4 {

enum class BoardRole : std::uint8_t;
struct Command;
class Setpoints;
struct SessionOptions;

// Called by the constructors of the boards and of Session.
void require_valid(const SessionOptions& options);

// A watcher may stop its board and ask for its identity. Other commands throw.
void require_control(BoardRole role, std::string_view what);
void require_control(BoardRole role, const Command& command);
void require_control(BoardRole role, const Setpoints& group);

// The timeout of a command must be longer than 0 ms. A stop is sent with any timeout.
void require_timeout(std::string_view what, std::chrono::milliseconds timeout);

// A time to wait: 0 checks without waiting.
void require_wait(std::string_view what, std::chrono::milliseconds timeout);

// The period of the application watchdog: up to an hour; 0 turns it off.
void require_watchdog(std::chrono::milliseconds period);
// The longest time of a callback: up to an hour; 0 for no limit.
void require_callback_limit(std::chrono::milliseconds limit);

// For a host that sends a heartbeat every `ours`: two must fit into the board's timeout.
void require_link_timing(std::chrono::milliseconds timeout, std::chrono::milliseconds heartbeat,
                         std::chrono::milliseconds ours);

}  // namespace r4
