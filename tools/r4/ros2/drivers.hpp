// SPDX-License-Identifier: GPL-3.0-or-later
// Tracks the publisher that drives each output, and publishers that have disappeared.
//     free --a command that drives--> driven --a command that stops, or its publisher--> stopping
//      ^                                 ^     has left or is silent for the deadline        |
//      |                                 +----------- a command that drives -----------------+
//      +----------------------------- stopped, the board has confirmed it -------------------+
// A stop may be lost, so it is repeated. A stopped output is as in the safe state, except relay 1,
// the motors' supply, which belongs to arming. A stepper's position is kept, because only one of a
// state's datagrams has it. The time is passed in, and continues while this computer sleeps.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "r4link/command.hpp"
#include "r4link/control/boot_clock.hpp"
#include "r4link/state.hpp"

namespace r4::tool::ros2 {

// True for kinds with driven channels. Z moves nothing.
constexpr bool is_driven(const CommandRow& row) {
  return joins_groups(row.kind) && row.kind != CommandKind::zero;
}
constexpr std::size_t number_of_outputs() {
  std::size_t outputs = 0;
  for (const CommandRow& row : command_rows) outputs += is_driven(row) ? row.channels : 0U;
  return outputs;
}

class Drivers {
 public:
  using Time = BootClock::time_point;
  using Duration = std::chrono::milliseconds;

  // An output is stopped after its publisher was silent for `deadline`, or has disappeared. 0: a
  // silent publisher is allowed.
  explicit Drivers(Duration deadline) : deadline_(deadline) {}

  static bool rests(const Command& command);
  // `source`: the topic; `publisher`: a publisher of that topic.
  void on_sent(const Command& command, const void* source, std::uint64_t publisher, Time now);
  // If `command` is a Z, `pnum` is its packet number or a later one; 0: unknown.
  void on_number(const Command& command, std::uint32_t pnum);
  void on_state(const State& state, Time sampled);
  void on_publishers(const void* source, const std::vector<std::uint64_t>& there);
  // Call when the outputs were made safe otherwise.
  void forget();
  // Call when the board does not have the output of `command`.
  void forget(const Command& command);

  // Commands that stop outputs now, at most max_group, repeated until stopped() or a driving
  // command. A stepper waits for its position. Voltages, missing on some boards, are stopped last.
  struct Stop {
    std::vector<Command> commands;
    std::uint64_t sent = 0;  // number of commands sent before to_stop()
    bool missed = false;     // a publisher has disappeared or is silent
  };
  Stop to_stop(Time now);
  // The board has confirmed `stop`. Outputs driven since then are not affected.
  void stopped(const Stop& stop);
  bool any() const;

 private:
  enum class Stage : std::uint8_t { free, driven, stopping };
  struct Output {
    Stage stage = Stage::free;
    const void* source = nullptr;
    std::uint64_t publisher = 0;
    Time last{};
    std::uint64_t sent = 0;
    bool asked = false;
  };
  struct Position {
    std::int32_t steps = 0;
    std::optional<Time> sampled;
    Time counts_from{};      // older samples may count from another zero
    std::uint32_t zero = 0;  // a state with this CMD or a later CMD counts from the newest zero
  };
  // With an older position a stepper would move instead of stop.
  static constexpr Duration oldest_position{250};
  // Z may be lost, and then no state shows its number. Z is not delayed for longer.
  static constexpr Duration longest_way{1000};
  static constexpr std::size_t outputs = number_of_outputs();
  static std::optional<std::size_t> index_of(const Command& command);
  std::optional<Command> stop_of(std::size_t index, Time now) const;

  const Duration deadline_;
  std::uint64_t sent_ = 0;
  std::array<Output, outputs> outputs_{};
  std::array<Position, stepper_channels> positions_{};
};

}  // namespace r4::tool::ros2
