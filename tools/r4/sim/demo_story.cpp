// SPDX-License-Identifier: GPL-3.0-or-later
#include "demo_story.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <vector>

#include "protocol/messages/message.hpp"
#include "r4link/link.hpp"

namespace r4::tool {
namespace {

constexpr int questions = 25;
constexpr int shown_states = 3;
constexpr std::chrono::milliseconds streaming{600};
constexpr std::chrono::milliseconds patience{5000};
constexpr double timeout_ms = 1000;
// How long a busy computer may delay a simulated board. A real board is safe 20 ms after its
// timeout (docs/reference/safety.md). The story reports the measured time.
constexpr double held_up_ms = 1000;

const Drive commanded{358, Direction::forward};
// Encoder counts that prove a motor with supply: more than a motor without supply can reach.
constexpr std::int32_t turned = 100;

class NotSo : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

double milliseconds(std::chrono::steady_clock::duration time) {
  return std::chrono::duration<double, std::milli>(time).count();
}
double milliseconds_of(const CommandResult& result) {
  return std::chrono::duration<double, std::milli>(result.elapsed).count();
}

BoardOptions without_arming() {
  BoardOptions options;
  options.session.arming = Arming::off;
  return options;
}

}  // namespace

Story::Story(asio::io_context& io, const std::string& url, const BoardLog* log, Teller teller)
    : io_(io), log_(log), teller_(std::move(teller)), board_(io, url, without_arming()) {
  result_.transport = url;
  board_.on_state([this](const State& state, const Datagram& datagram) {
    state_ = state;
    state_bytes_.assign(datagram.bytes().data(), datagram.bytes().size());
    state_came_ = Clock::now();
    ++states_;
  });
  board_.on_board_heartbeat([this](const Datagram& datagram) {
    if (heartbeat_reason(datagram) == SafeReason::none) return;
    safe_bytes_.assign(datagram.bytes().data(), datagram.bytes().size());
    safe_t_ms_ = static_cast<std::uint32_t>(datagram.time_ms());
  });
}

StoryResult Story::run() {
  try {
    connect();
    stream();
    ask();
    command();
    fall_silent();
    recover();
    stop();
    clear();
    result_.good = true;
  } catch (const NotSo& trouble) {
    result_.trouble = trouble.what();
  } catch (const Error& error) {
    result_.trouble = error.problem().text();
  }
  result_.lost = board_.statistics().packets.lost;
  board_.close();
  io_.restart();
  io_.poll();
  return result_;
}

bool Story::wait_until(const std::function<bool()>& is_so, Milliseconds at_most) {
  const Clock::time_point end = Clock::now() + at_most;
  while (!is_so()) {
    io_.restart();
    if (io_.run_one_until(end) == 0) return is_so();
  }
  return true;
}

void Story::require(bool is_so, const std::string& what) const {
  if (!is_so) throw NotSo(what);
}

bool Story::active() const {
  const LinkStatus& link = board_.link();
  return link.state == HostLinkState::active && !link.causes.has(LinkCause::busy);
}

CommandResult Story::send(const Command& command) {
  ended_.reset();
  board_.async_send(command, patience, [this](const CommandResult& result) { ended_ = result; });
  wait_until([this] { return ended_.has_value(); }, 2 * patience);
  if (!ended_ || ended_->outcome != Outcome::confirmed) {
    throw Error(explain(command, ended_.value_or(CommandResult()), board_.link()));
  }
  return *ended_;
}

void Story::connect() {
  const Clock::time_point start = Clock::now();
  board_.open();
  const bool heard = wait_until([this] { return active() && states_ != 0; }, patience);
  if (!heard) throw Error(explain(board_.name(), board_.link()));
  result_.connect_ms = milliseconds(Clock::now() - start);
  teller_.say(
      fmt::format("connect   The host sent a heartbeat. The board answered, and the host has "
                  "control: {:.0f} ms.",
                  result_.connect_ms));
}

void Story::stream() {
  teller_.say("stream    Now the board sends its state a hundred times a second:");
  const std::uint64_t first = states_;
  const Clock::time_point start = state_came_;
  const std::uint32_t start_t_ms = state_.t_ms;
  for (int i = 1; i <= shown_states; ++i) {
    const std::uint64_t wanted = first + static_cast<std::uint64_t>(i);
    require(wait_until([&] { return states_ >= wanted; }, patience), "the board stopped streaming");
    teller_.show(state_bytes_);
  }
  wait_until([&] { return Clock::now() - start > streaming; }, streaming);
  // Uses the board's clock: a busy computer may receive states late and in groups.
  result_.rate_hz = static_cast<double>(states_ - first) / (state_.t_ms - start_t_ms) * 1000;
  teller_.say(fmt::format("          {:.1f} states a second, packet numbers (PNum) without a gap.",
                          result_.rate_hz));
  // No lower limit: a simulated board on a busy computer skips states.
  require(result_.rate_hz < 110, "the board streams faster than 100 Hz");
}

void Story::ask() {
  std::vector<double> times;
  times.reserve(questions);
  for (int i = 0; i < questions; ++i) {
    times.push_back(static_cast<double>(send(Command::identify()).elapsed.count()));
  }
  std::nth_element(times.begin(), times.begin() + questions / 2, times.end());
  result_.round_trip_us = times[questions / 2];
  const BoardIdentity& id = board_.identity();
  teller_.say(fmt::format(
      "ask       The host asks for the identity: board {}, firmware {}. Round trip: {:.0f} us.",
      id.board_id, id.firmware, result_.round_trip_us));
}

void Story::command() {
  send(Command::fields("DEFAULT,ENC1"));
  send(Command::relay(1, true));
  teller_.say(
      "supply    R:1,On closes relay 1, which is in the motors' supply and opens in every safe "
      "state.");
  result_.confirmed_ms = milliseconds_of(send(Command::osmc(1, Pwm(358), Direction::forward)));
  require(state_.osmc(1) == commanded, "the state does not show the command");
  teller_.say(
      "command   O:358,1,1 sets motor 1 (OSMC1) to 358 of 4095, forward. The state shows it:");
  teller_.show(state_bytes_);
  teller_.say(fmt::format("          This state confirms the command, after {:.1f} ms.",
                          result_.confirmed_ms));
  require_that_the_motor_turns();
  teller_.say("          The motor turns, and the encoder on its shaft (ENC1) counts:");
  teller_.show(state_bytes_);
}

void Story::require_that_the_motor_turns() {
  const std::int32_t from = state_.encoder(1);
  require(wait_until([&] { return state_.encoder(1) - from > turned; }, patience),
          "the motor does not turn");
}

// Stops the heartbeats through the watchdog, as a hung application would.
void Story::fall_silent() {
  std::uint64_t heartbeats = board_.statistics().heartbeats;
  Clock::time_point last = Clock::now();
  const auto sent_another = [&] {
    const std::uint64_t now = board_.statistics().heartbeats;
    if (now == heartbeats) return false;
    heartbeats = now;
    last = Clock::now();
    return true;
  };
  require(wait_until(sent_another, patience), "the host does not send heartbeats");
  board_.watchdog(Milliseconds(1));
  const auto board_is_safe = [&] {
    sent_another();
    return board_.link().state == HostLinkState::safe && board_.link().reason == SafeReason::link;
  };
  require(wait_until(board_is_safe, patience),
          "the board did not go safe when the heartbeats stopped");
  const State last_state = state_;
  if (log_ != nullptr) {
    require(wait_until([this] { return log_->silence_ms && log_->outputs_off; }, patience),
            "the board's log does not report a safe state");
    result_.safe_ms = *log_->silence_ms;
    result_.safe_by_event = true;
  } else {
    // Board time of the last heartbeat, derived from T of the newest state.
    const double age_ms = milliseconds(state_came_ - last);
    result_.safe_ms = static_cast<double>(safe_t_ms_ - last_state.t_ms) + age_ms;
  }
  teller_.say(
      "silence   The host stops its heartbeats, as a hung program would. The board waits one "
      "second:");
  teller_.show(safe_bytes_);
  teller_.say(
      fmt::format("          SAFE:1: every output is off, {:.0f} ms after the last heartbeat.",
                  result_.safe_ms));
  require(result_.safe_ms <= timeout_ms + held_up_ms, "the board went safe too late");
  // Without the log the time may be too short, if this computer was delayed.
  require(!result_.safe_by_event || result_.safe_ms >= timeout_ms, "the board went safe too early");
}

void Story::recover() {
  const Clock::time_point start = Clock::now();
  const std::uint64_t before = states_;
  board_.watchdog(Milliseconds(0));
  const auto is_back = [&] { return active() && states_ > before && state_.osmc(1) == commanded; };
  require(wait_until(is_back, patience), "the last command was not restored");
  result_.recovered_ms = milliseconds(Clock::now() - start);
  teller_.say(
      "recovery  The heartbeats return, and the board restores its last command by itself:");
  teller_.show(state_bytes_);
  teller_.say(fmt::format("          {:.0f} ms after the first heartbeat.", result_.recovered_ms));
  require_that_the_motor_turns();
}

void Story::stop() {
  result_.stop_ms = milliseconds_of(send(Command::stop()));
  const auto is_off = [this] {
    return state_.safe == SafeReason::stop && state_.osmc(1) == Drive();
  };
  require(wait_until(is_off, patience), "the state does not show the stop");
  teller_.say("stop      E:STOP is the emergency stop. The board obeys it from every program:");
  teller_.show(state_bytes_);
  teller_.say(
      fmt::format("          SAFE:2: motor off and relay 1 open, confirmed after {:.1f} ms. It "
                  "lasts until E:CLEAR.",
                  result_.stop_ms));
}

void Story::clear() {
  send(Command::clear());
  const std::uint64_t before = states_;
  require(wait_until([&] { return active() && states_ > before; }, patience),
          "E:CLEAR did not clear the stop");
  require(state_.osmc(1) == Drive(), "a command was restored after an emergency stop");
  teller_.say(
      "clear     E:CLEAR allows it to move again. Nothing comes back by itself: the motor is off, "
      "and "
      "has no\n            supply until the next R:1,On.");
}

}  // namespace r4::tool
