// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <optional>
#include <string>

#include "check_functions.hpp"
#include "r4link/error.hpp"

namespace r4::commissioning {
namespace {

using namespace std::chrono_literals;

// An OSMC motor that turned the encoder of its number; 0 if there is none.
int motor_with_encoder(const Report& report) {
  for (int i = 1; i <= osmc_channels; ++i) {
    const auto result =
        std::find_if(report.checks.begin(), report.checks.end(),
                     [&](const CheckResult& each) { return each.id == fmt::format("osmc {}", i); });
    if (result == report.checks.end() || result->status != Status::passed) continue;
    for (const Measured& each : result->measured) {
      if (each.what == fmt::format("encoder {}, forward", i)) return i;
    }
  }
  return 0;
}

}  // namespace

void check_transports(Checking& c, int) {
  const auto transports = c.board.transports();
  for (std::size_t i = 0; i < transports.size(); ++i) {
    try {
      const auto quality = c.board.measure(i, 2s);
      c.measured(transports[i] + ": states", quality.states_a_second, "a second");
      c.measured(transports[i] + ": lost", quality.loss * 100, "%");
      if (quality.round_trip_ms > 0) {
        c.measured(transports[i] + ": round trip", quality.round_trip_ms, "ms");
      }
    } catch (const Error& error) {
      if (i == 0) throw;
      c.found_at(transports[i], Finding::transport_dead, error.problem().reason);
    }
  }
}

// On a lost link the board goes safe and ends its states, so the last state gives the time.
void check_silence(Checking& c, int) {
  constexpr Duration longest = 1500ms;  // the default timeout plus a margin
  constexpr std::int32_t expected_ms = 1030;
  constexpr Duration coasting = 2s;  // time for a motor without current to stop
  constexpr int states_to_speed = 30;
  const int motor = motor_with_encoder(c.report);
  std::string text = "Relay 1 closes (a click). ";
  Command command = Command::relay(1, true);
  std::optional<Command> rest;
  if (motor != 0) {
    text += fmt::format("OSMC {} turns forward at a tenth of full duty. ", motor);
    command = Command::osmc(motor, Duty(0.1));
    rest = Command::osmc(motor, Pwm(0), Direction::reverse);
  }
  text +=
      "Then this program stops its heartbeats: within about a second the board must switch all "
      "outputs off. Hold the key until then.";
  c.select_fields("ENC1,ENC2,ENC3,ENC4");
  ReceivedState began, last;
  bool by_itself = false;
  c.hold({c.check.id, text, command, 2s}, rest, [&] {
    if (!c.watch(began)) return;
    c.drive(command);
    for (int i = 0; i < states_to_speed; ++i) {
      if (!c.watch(began)) return;
    }
    last = began;
    c.board.be_silent(true);
    bool held = true;
    try {
      while (held && Duration(last.t_ms - began.t_ms) < longest) held = c.watch(last);
    } catch (const Error&) {  // the states have ended, and the next heartbeat reports the cause
      c.board.next_state(1s);
      by_itself = c.board.link().reason == SafeReason::link;
    }
    c.board.stop();  // clears the setpoints, which the next heartbeat would restore
    c.board.be_silent(false);
    if (held && !by_itself) c.found(Finding::silence_too_long);
  });
  c.board.wait_heard();
  c.board.forget_states();
  const ReceivedState at_rest = c.collect(coasting).back();
  const ReceivedState later = c.collect(300ms).back();
  c.send(Command::clear());
  if (!by_itself)
    Checking::give_up(Status::not_done, "the key was released before the board was safe");
  const auto safe_after_ms = static_cast<std::int32_t>(last.t_ms - began.t_ms);
  c.measured("silence to safe, by the board's clock", safe_after_ms, "ms");
  if (safe_after_ms > expected_ms) c.found(Finding::silence_too_long);
  if (motor == 0)
    return c.note("a motor with an encoder has not turned yet, so only relay 1 was closed");
  const std::int32_t counts = later.encoder(motor) - at_rest.encoder(motor);
  c.measured(fmt::format("encoder {} in the safe state", motor), counts, "counts in 0.3 s");
  if (std::abs(counts) > 2) c.found(Finding::rolls_on);
}

void check_stop(Checking& c, int) {
  constexpr Duration limit = 300ms;
  const auto transports = c.board.transports();
  const Command relay_1 = Command::relay(1, true);
  c.select_fields("RELAYS");
  for (std::size_t i = 0; i < transports.size(); ++i) {
    const std::string text =
        fmt::format("Relay 1 closes (a click). Then a stop over {} opens it.", transports[i]);
    std::optional<std::int32_t> stopped_ms;
    bool held = false;
    c.hold({c.check.id, text, relay_1, 2s}, std::nullopt, [&] {
      ReceivedState before;
      held = c.watch(before);
      if (!held) return;
      try {
        c.board.stop_over(i);
      } catch (const Error& error) {
        if (i == 0) throw;
        c.found_at(transports[i], Finding::transport_dead, error.problem().reason);
        return;
      }
      for (const ReceivedState& state : c.collect(limit)) {
        if (state.safe == SafeReason::none || state.relays != 0) {
          before = state;
        } else if (!stopped_ms) {
          stopped_ms = static_cast<std::int32_t>(state.t_ms - before.t_ms);
        }
      }
      if (!stopped_ms) c.found_at(transports[i], Finding::stop_too_slow);
    });
    if (!held) Checking::give_up(Status::not_done, "the key was released");
    if (stopped_ms) c.measured(transports[i] + ": stop, to a state", *stopped_ms, "ms");
    c.send(Command::clear());
  }
}

}  // namespace r4::commissioning
