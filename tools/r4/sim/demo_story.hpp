// SPDX-License-Identifier: GPL-3.0-or-later
// The demonstration on one board (paper sections 4.3 and 4.4). The first step that fails ends it.
#pragma once

#include <asio/io_context.hpp>
#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "../shell/json.hpp"
#include "r4link/async_board.hpp"

namespace r4::tool {

// Measurements on one transport; 0: step not reached.
struct StoryResult {
  std::string transport;
  double connect_ms = 0;
  double rate_hz = 0;
  std::uint64_t lost = 0;
  double round_trip_us = 0;
  double confirmed_ms = 0;
  double safe_ms = 0;          // from the host's last heartbeat to the safe state
  bool safe_by_event = false;  // measured by the board's own log, else by T of the datagrams
  double recovered_ms = 0;
  double stop_ms = 0;
  bool good = false;
  std::string trouble;
};

struct BoardLog {
  std::optional<std::uint32_t> silence_ms;  // silence before the newest SAFE (link)
  bool outputs_off = false;
};

class Story {
 public:
  struct Teller {
    std::function<void(std::string_view)> say;
    std::function<void(std::string_view)> show;
  };

  // If `log` is not null, handlers of `io` must update the log.
  Story(asio::io_context& io, const std::string& url, const BoardLog* log, Teller teller);

  StoryResult run();

 private:
  using Clock = std::chrono::steady_clock;
  using Milliseconds = std::chrono::milliseconds;

  bool wait_until(const std::function<bool()>& is_so, Milliseconds at_most);
  CommandResult send(const Command& command);
  void require(bool is_so, const std::string& what) const;
  bool active() const;

  void connect();
  void stream();
  void ask();
  void command();
  void require_that_the_motor_turns();
  void fall_silent();
  void recover();
  void stop();
  void clear();

  asio::io_context& io_;
  const BoardLog* log_;
  Teller teller_;
  AsyncBoard board_;
  StoryResult result_;

  State state_;
  std::string state_bytes_;
  Clock::time_point state_came_;
  std::uint64_t states_ = 0;
  std::string safe_bytes_;
  std::uint32_t safe_t_ms_ = 0;
  std::optional<CommandResult> ended_;
};

}  // namespace r4::tool
