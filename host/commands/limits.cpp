// SPDX-License-Identifier: GPL-3.0-or-later
#include "limits.hpp"

#include <fmt/format.h>

#include <cstdint>
#include <string>

#include "../commands/link_timing.hpp"
#include "r4link/commands/command_text.hpp"
#include "r4link/error.hpp"
#include "r4link/options.hpp"
#include "r4link/tables/commands.hpp"

namespace r4 {

namespace {

constexpr std::int64_t minute_ms = 60'000;
constexpr std::int64_t hour_ms = 60 * minute_ms;

void require(std::string_view what, std::int64_t value_ms, std::int64_t min_ms, std::int64_t max_ms,
             std::string_view none = "") {
  if (value_ms >= min_ms && value_ms <= max_ms) return;
  if (value_ms == 0 && !none.empty()) return;
  throw Error(ErrorKind::usage, fmt::format("{} of {} ms", what, value_ms), "is out of range",
              fmt::format("give {} to {} ms{}{}", min_ms, max_ms, none.empty() ? "" : "; ", none));
}

}  // namespace

void require_valid(const SessionOptions& options) {
  require("timing.heartbeat_ms", options.timing.heartbeat_ms, 1, minute_ms);
  require("timing.timeout_ms", options.timing.timeout_ms, 1, hour_ms);
  if (options.watch_rate_hz < 1 || options.watch_rate_hz > state_rate_max_hz) {
    throw Error(ErrorKind::usage, fmt::format("watch_rate_hz of {}", options.watch_rate_hz),
                "is out of range", fmt::format("give 1 to {} states a second", state_rate_max_hz));
  }
  require("command_retry", options.command_retry.count(), 1, minute_ms);
  require("stop_retry", options.stop_retry.count(), 1, 1000);
  require("identify_interval", options.identify_interval.count(), 1, hour_ms, "0 turns this off");
}

void require_control(BoardRole role, std::string_view what) {
  if (role == BoardRole::control) return;
  throw Error(ErrorKind::usage, std::string(what), "this program only watches the board",
              "call take_control() first, or open the board with BoardRole::control");
}

void require_control(BoardRole role, const Command& command) {
  if (role == BoardRole::control || command.kind == CommandKind::stop ||
      is_question(command.kind)) {
    return;
  }
  require_control(role, shown(command));
}

void require_control(BoardRole role, const Setpoints& group) {
  if (role != BoardRole::control) require_control(role, to_text(group));
}

void require_timeout(std::string_view what, std::chrono::milliseconds timeout) {
  if (timeout.count() > 0) return;
  throw Error(ErrorKind::usage, fmt::format("{} within {} ms", what, timeout.count()),
              "the timeout must be longer than 0 ms",
              "give a timeout of at least 1 ms; post() sends without waiting");
}

void require_wait(std::string_view what, std::chrono::milliseconds timeout) {
  if (timeout.count() >= 0) return;
  throw Error(ErrorKind::usage, fmt::format("{} within {} ms", what, timeout.count()),
              "the timeout must not be negative",
              "give a timeout of at least 0 ms; 0 returns at once");
}

void require_link_timing(std::chrono::milliseconds timeout, std::chrono::milliseconds heartbeat,
                         std::chrono::milliseconds ours) {
  require("a board's timeout", timeout.count(), least_timeout_ms, 10'000);
  require("a board's heartbeat interval", heartbeat.count(), least_heartbeat_ms, 1000);
  const std::string thing =
      fmt::format("timeout {} ms, heartbeat {} ms", timeout.count(), heartbeat.count());
  if (heartbeat >= timeout) {
    throw Error(ErrorKind::usage, thing, "the heartbeat interval is not below the timeout",
                "give a shorter interval, such as a third of the timeout");
  }
  if (timeout < 2 * ours) {
    throw Error(
        ErrorKind::usage, thing,
        fmt::format("this program sends a heartbeat only every {} ms, so the board would go safe "
                    "again and again",
                    ours.count()),
        fmt::format("set SessionOptions::timing.heartbeat_ms to {} first", timeout.count() / 3));
  }
}

void require_watchdog(std::chrono::milliseconds period) {
  require("watchdog()", period.count(), 1, hour_ms, "0 turns this off");
}

void require_callback_limit(std::chrono::milliseconds limit) {
  require("callback_limit", limit.count(), 1, hour_ms, "0 turns this off");
}

}  // namespace r4
