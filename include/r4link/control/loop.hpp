// SPDX-License-Identifier: GPL-3.0-or-later
// A control loop that runs once per state of the board, and ends if its input is unreliable.
//     r4::control::LoopOptions options;
//     options.fields = "ENC1";
//     options.rest.add(r4::Command::osmc(1, r4::Duty(0)));
//     options.standstill = {{.encoder = 1, .channel = 1}};
//     const auto end = r4::control::run_loop(board, options, [&](const auto& step) {
//       const double duty = pid.step(1.2, wheel.speed_m_s(), step.dt_s);
//       return std::optional(r4::Setpoints{r4::Command::osmc(1, r4::Duty(duty))});
//     });
//     std::puts(end.why.c_str());
//
// Each new state with the needed fields causes a step. The time since the last step is measured on
// the board's clock, so delays, losses and bursts of the link do not falsify it. The loop ends when
//     late         the newest state with these fields was sampled longer ago than `late`
//     not active   the board is safe, or the link to it is not up
//     disarmed     output commands are refused: Board::disarmed_by()
//     standstill   a motor is driven, but its encoder does not move
//     asked        the step returns no setpoints
//
// and then sets the outputs to `rest`, confirmed by the board. The loop does not restart by itself.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "../board.hpp"
#include "../config.hpp"
#include "../link.hpp"
#include "../setpoints.hpp"

namespace r4::control {

enum class LoopEnd : std::uint8_t { none, asked, late, not_active, disarmed, standstill };
// "none", "asked", "late", "not active", "disarmed", "standstill"; "unknown" for other numbers.
R4LINK_API const char* to_text(LoopEnd end);

// A blocked motor may burn. A loop with an unplugged encoder would drive at full duty.
struct Standstill {
  int encoder = 1;                        // ENCn
  CommandKind drive = CommandKind::osmc;  // or dhb12, bldc
  int channel = 1;
  int pwm = 400;                        // if driven with at least this duty, of 4095 …
  int counts = 3;                       // … the encoder must move by more counts than this …
  std::chrono::milliseconds time{500};  // … within this time
};

struct LoopOptions {
  // Names of the state fields that each step needs, "ENC1,AINSTEER". Request them from the board
  // with SessionOptions::fields or Board::fields().
  std::string fields = {};
  std::chrono::milliseconds late{100};
  // Time limit for the first state.
  std::chrono::milliseconds first{1000};
  std::vector<Standstill> standstill = {};

  // For run_loop() only:

  // The same as SessionOptions::arming of the board.
  Arming arming = Arming::required;
  // The outputs after the loop: 0 for each motor that the loop drives. Must not be empty.
  Setpoints rest = {};
  // If the board does not confirm `rest` within this time, the loop stops it (E:STOP).
  std::chrono::milliseconds rest_timeout{200};
  // If a step takes longer, the heartbeats stop: the board goes safe (Board::watchdog()). 0: off.
  std::chrono::milliseconds watchdog{300};
};

struct LoopStep {
  const ReceivedState& state;
  double dt_s = 0;  // on the board's clock, since the last step; 0 in the first step
};

// The loop without a board, thread or clock: for an AsyncBoard, a simulation or a loop of your own.
class R4LINK_API LoopGuard {
 public:
  using Clock = std::chrono::steady_clock;

  // Throws Error{usage} for unknown fields, channels and encoders, and for times not above 0.
  explicit LoopGuard(LoopOptions options);

  void start(Clock::time_point now);
  // Call on_state() for each state. If a step is due, returns the seconds since the last step.
  std::optional<double> on_state(const ReceivedState& state, DisarmCause disarmed,
                                 Clock::time_point now);
  // Call on_commanded() with each step's commands. Other motors keep their last commands.
  void on_commanded(const Setpoints& setpoints);
  // Call check() at deadline(), and when the link or the arming changes. LoopEnd::none: continue.
  LoopEnd check(HostLinkState link, DisarmCause disarmed, Clock::time_point now);
  // If no state arrives before this time, the loop ends as late.
  Clock::time_point deadline() const { return deadline_; }
  void end(LoopEnd cause, std::string why);

  LoopEnd ended() const { return end_; }
  // The end in words: "ENC1 stands still, although OSMC 1 is driven with 1200 for 500 ms; …".
  const std::string& why() const { return why_; }

 private:
  struct Motor {
    Standstill limits;
    int pwm = 0;  // commanded
    bool watched = false;
    std::uint32_t since_ms = 0;  // start of driving without motion
    std::int32_t counts = 0;     // the count at that time
  };

  bool is_ready(const ReceivedState& state);
  void look_at_motors(const ReceivedState& state);

  LoopOptions options_;
  FieldSet needed_;
  std::vector<Motor> motors_;
  FieldSet got_;  // fields of the state with T got_ms_
  std::uint32_t got_ms_ = 0;
  std::optional<std::uint32_t> last_ms_;  // T of the last step
  Clock::time_point deadline_ = Clock::time_point::max();
  LoopEnd end_ = LoopEnd::none;
  std::string why_;
};

struct LoopReport {
  LoopEnd end = LoopEnd::none;
  std::string why;
  // True if the outputs are at `rest` or safe. False: neither `rest` nor a stop was confirmed.
  bool at_rest = false;
  std::uint64_t steps = 0;
};

// Runs the loop on this thread until it ends. The step returns setpoints to post, or std::nullopt
// to end the loop. Sets the board's recovery to `rearm`: then a lost link does not restore outputs
// when no loop runs. An exception from the step is thrown when the outputs are at rest. Throws
// Error{usage} for wrong options (also an empty `rest`), and errors of Board without an answer.
R4LINK_API LoopReport
run_loop(Board& board, const LoopOptions& options,
         const std::function<std::optional<Setpoints>(const LoopStep&)>& step);

}  // namespace r4::control
