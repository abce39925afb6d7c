// SPDX-License-Identifier: GPL-3.0-or-later
// Which publisher drives which output, and which of them have gone.
//
//     free --a command that drives--> driven --a command that stops, its publisher has gone, or--> stopping
//      ^                                 ^     is silent for the deadline                            |
//      |                                 +---------------- a command that drives --------------------+
//      +---------------------------------- stopped, the board has confirmed it -----------------------+
//
// A command that stops goes out once like the others, and might be lost: so it, too, is repeated until the board has
// confirmed it. What is stopped goes where the board's safe state puts it: motors to 0, brushless drivers to 0 with
// their brakes on, servos without pulses, relays open, steppers standing where they are, voltages to 0. Relay 1 is no
// output here: it is the motors' supply, and arming's. Where a stepper is, is known for a while, for a state may come in
// several datagrams, of which one has it. No clock: the time is passed in. It goes on while this
// computer sleeps.
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

// True for the kinds whose channels are driven. Z moves nothing.
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

  // A deadline of 0: only who has gone is missed.
  explicit Drivers(Duration deadline) : deadline_(deadline) {}

  // Does an output rest after it?
  static bool rests(const Command& command);
  // `source`: the topic; `publisher`: of that topic.
  void on_sent(const Command& command, const void* source, std::uint64_t publisher, Time now);
  // A datagram of the board, sampled then: where its steppers are.
  void on_state(const State& state, Time sampled);
  // Those of a topic that are left.
  void on_publishers(const void* source, const std::vector<std::uint64_t>& there);
  // Somebody else has made the outputs safe.
  void forget();
  // The board does not know such a command: there is no such output.
  void forget(const Command& command);

  // Commands for what is to be stopped now, for each output until stopped() or a command that drives it. At most
  // max_group. A stepper waits for its position; voltages, which not every board has, for the others.
  struct Stop {
    std::vector<Command> commands;
    std::uint64_t sent = 0;  // commands before it
    bool missed = false;     // who drove one of them has gone or is silent
  };
  Stop to_stop(Time now);
  // The board has confirmed it. What was driven again since is not stopped by that.
  void stopped(const Stop& stop);
  bool any() const;

 private:
  enum class Stage : std::uint8_t { free, driven, stopping };
  struct Output {
    Stage stage = Stage::free;
    const void* source = nullptr;
    std::uint64_t publisher = 0;
    Time last{};
    std::uint64_t sent = 0;  // which command it was
    bool asked = false;      // to stop
  };
  struct Position {
    std::int32_t steps = 0;
    std::optional<Time> sampled;
    Time counts_from{};  // what was sampled before is counted from another zero
  };
  // A stepper that was sent to an older position would move, not stop.
  static constexpr Duration oldest_position{250};
  // Of Z to the board: a state of meanwhile may still be of before.
  static constexpr Duration longest_way{100};
  static constexpr std::size_t outputs = number_of_outputs();
  static std::optional<std::size_t> index_of(const Command& command);
  std::optional<Command> stop_of(std::size_t index, Time now) const;

  const Duration deadline_;
  std::uint64_t sent_ = 0;
  std::array<Output, outputs> outputs_{};
  std::array<Position, stepper_channels> positions_{};
};

}  // namespace r4::tool::ros2
