// SPDX-License-Identifier: GPL-3.0-or-later
// Output of `r4 sim`, as text or JSON. A slow reader does not delay a board.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "../shell/json.hpp"
#include "../shell/output.hpp"
#include "firmware/ports/sim/simulated_board.hpp"
#include "transports/impaired/impaired_carrier.hpp"

namespace r4::tool {

class SimOutput {
 public:
  explicit SimOutput(bool json);

  // Call after the boards have started. Earlier lines are printed after the URLs.
  void listening(const std::vector<std::string>& urls);
  void print(std::string line);
  void problem(const Problem& problem);

  bool json() const { return json_; }

 private:
  const bool json_;
  bool started_ = false;
  std::vector<std::string> held_;
  LineWriter writer_;
};

class SimLog {
 public:
  // For several boards, `name` is part of each event. Otherwise `name` is empty.
  SimLog(SimOutput& output, bool quiet, std::string name)
      : output_(output), quiet_(quiet), name_(std::move(name)) {}

  // The log must outlive the board.
  sim::SimulatedBoard::Events events();
  // Call before the board's start().
  void watch(const sim::SimulatedBoard& board) { board_ = &board; }
  void tell_sensors();
  void on_end(const Carrier& carrier);
  void on_impairment(const ImpairedCarrier& link);

 private:
  Json event(std::uint32_t t_ms) const;
  void on_state(std::uint32_t t_ms, firmware::BoardState state, SafeReason reason);
  void on_pins(std::uint32_t t_ms, const sim::Pins& pins);
  void on_step(std::uint32_t t_ms, const sim::ScriptStep& step);
  void on_fault(std::uint32_t t_ms, ChipFault fault);
  void on_executed(std::uint32_t t_ms, std::uint32_t pnum, const Command& command);
  void on_refused(std::uint32_t t_ms, std::uint32_t pnum, Refusal code);
  void on_rejected(std::uint32_t t_ms, Verdict verdict);
  void on_path(std::uint32_t t_ms, const Carrier& carrier, bool joined);
  void on_carrier(std::uint32_t t_ms, const Carrier& carrier, const CarrierEvent& event);
  void print(const Json& object) { output_.print(line_of(object)); }
  void print(std::uint32_t t_ms, std::string_view text);

  SimOutput& output_;
  const bool quiet_;
  const std::string name_;
  const sim::SimulatedBoard* board_ = nullptr;
};

// The host's URL for a board's URL: "serial:///tmp/r4" for "pty:/tmp/r4".
std::string host_url(const std::string& board_url);

// {"osmc":[[pwm,dir],…],"dhb":…,"servo":[us,…],"relays":bits,"bldc":[[speed,dir,brake],…],
//  "stepper":[[position,stepping],…]}; stepping: 1 forward, -1 backward, 0 at rest
Json pins_json(const sim::Pins& pins);

// "OSMC1:358,1 SERVO1:2001": differences from the safe state; "all off".
std::string pins_text(const sim::Pins& pins);

// {"supply":true,"handle":"held","enc":[counts,…],"stepper":[steps,…],"us":[cm,…],
//  "analog":{"AIN24":24.28,…}}: motor supply and sensor readings; "off": no sensor is connected.
Json sensors_json(const sim::BoardModel& model);

}  // namespace r4::tool
