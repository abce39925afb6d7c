// SPDX-License-Identifier: GPL-3.0-or-later
// A control loop that runs by the board's states, and ends itself when it can no longer know what it does.
//
//     r4::control::LoopOptions options;
//     options.fields = "ENC1";
//     options.rest.add(r4::Command::osmc(1, r4::Duty(0)));
//     options.standstill = {{.encoder = 1, .channel = 1}};
//     const auto end = r4::control::run_loop(board, options, [&](const r4::control::LoopStep& step) {
//       const double duty = pid.step(1.2, wheel.speed_m_s(), step.dt_s);
//       return std::optional(r4::Setpoints{r4::Command::osmc(1, r4::Duty(duty))});
//     });
//     std::puts(end.why.c_str());
//
// A step is done for each new state that carries the fields it needs, and has the time that passed on the board's own
// clock since the last one: delays, losses and bursts of the link do not falsify it. The loop ends when
//
//     late         the newest such state was sampled longer ago than `late`
//     not active   the board is safe, or the link to it is not up
//     disarmed     output commands are refused: Board::disarmed_by()
//     standstill   a motor is driven, and its encoder stands
//     asked        the step says so
//
// and then leaves the outputs as `rest` has them, confirmed by the board. It does not begin again by itself.
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

// Why a loop has ended.
enum class LoopEnd : std::uint8_t { none, asked, late, not_active, disarmed, standstill };
// "none", "asked", "late", "not active", "disarmed", "standstill"; "unknown" for other numbers.
R4LINK_API const char* to_text(LoopEnd end);

// A motor that turns an encoder. One that is held fast burns, and an encoder whose cable is off makes its loop drive at
// full duty.
struct Standstill {
  int encoder = 1;                        // ENCn
  CommandKind drive = CommandKind::osmc;  // or dhb12, bldc
  int channel = 1;
  int pwm = 400;                        // driven at least so hard, of 4095 …
  int counts = 3;                       // … it turns by more than this …
  std::chrono::milliseconds time{500};  // … within so much time
};

struct LoopOptions {
  // Names of the state fields that each step needs, "ENC1,AINSTEER"; ask the board for them, with
  // SessionOptions::fields or Board::fields().
  std::string fields = {};
  std::chrono::milliseconds late{100};
  // So long the first one may take.
  std::chrono::milliseconds first{1000};
  std::vector<Standstill> standstill = {};

  // Of run_loop() alone.

  // As of the board: Arming::off where its SessionOptions::arming is.
  Arming arming = Arming::required;
  // What the loop leaves behind: 0 of each motor that it drives. Never empty.
  Setpoints rest = {};
  // If the board does not confirm that within so much time, it is stopped (E:STOP).
  std::chrono::milliseconds rest_timeout{200};
  // A step that does not return for so long stops the heartbeats, and the board goes safe (Board::watchdog()); 0: the
  // program feeds the watchdog itself, or does without.
  std::chrono::milliseconds watchdog{300};
};

struct LoopStep {
  const ReceivedState& state;
  double dt_s = 0;  // on the board's clock, since the step before; 0 in the first
};

// The same without a board, a thread or a clock: for an AsyncBoard, a simulation, a loop of another kind.
class R4LINK_API LoopGuard {
 public:
  using Clock = std::chrono::steady_clock;

  // Throws Error{usage} for fields that are none, for times of nothing, and for a Standstill whose channel or encoder
  // does not exist.
  explicit LoopGuard(LoopOptions options);

  void start(Clock::time_point now);
  // A state has come; the seconds since the last step if one is due, none if it is not, or the loop has ended.
  std::optional<double> on_state(const ReceivedState& state, DisarmCause disarmed,
                                 Clock::time_point now);
  // What the step commands: of a motor that it does not name, what was commanded before goes on.
  void on_commanded(const Setpoints& setpoints);
  // Has the loop ended? To be asked at deadline() at the latest, and whenever the link or the arming has changed.
  LoopEnd check(HostLinkState link, DisarmCause disarmed, Clock::time_point now);
  // When states will be late, if none comes until then.
  Clock::time_point deadline() const { return deadline_; }
  void end(LoopEnd cause, std::string why);

  LoopEnd ended() const { return end_; }
  // In words: "ENC1 stands still, although OSMC 1 is driven with 1200 for 500 ms; …".
  const std::string& why() const { return why_; }

 private:
  struct Motor {
    Standstill limits;
    int pwm = 0;  // commanded
    bool watched = false;
    std::uint32_t since_ms = 0;  // driven without moving, since
    std::int32_t counts = 0;     // where it stood then
  };

  bool is_ready(const ReceivedState& state);
  void look_at_motors(const ReceivedState& state);

  LoopOptions options_;
  FieldSet needed_;
  std::vector<Motor> motors_;
  FieldSet got_;  // of the state of got_ms_
  std::uint32_t got_ms_ = 0;
  std::optional<std::uint32_t> last_ms_;  // of the last step
  Clock::time_point deadline_ = Clock::time_point::max();
  LoopEnd end_ = LoopEnd::none;
  std::string why_;
};

struct LoopReport {
  LoopEnd end = LoopEnd::none;
  std::string why;
  // How it left the outputs: as `rest` has them, or safe. If not even a stop was confirmed, `why` says what to do.
  bool at_rest = false;
  std::uint64_t steps = 0;
};

// Runs the loop on this thread until it ends. The step returns what is to be posted, or nothing to end the loop. Sets
// the board's recovery to `rearm`: what a lost link took away does not come back by itself, with no loop there. Throws
// what the step throws, after the outputs are at rest, and Error for options that cannot be and a board that is not
// there.
R4LINK_API LoopReport
run_loop(Board& board, const LoopOptions& options,
         const std::function<std::optional<Setpoints>(const LoopStep&)>& step);

}  // namespace r4::control
