// SPDX-License-Identifier: GPL-3.0-or-later
// What `r4 sim` prints: where the board listens and its own events, in words or as JSON. A slow
// reader does not hold the board up.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "firmware/ports/sim/simulated_board.hpp"
#include "json.hpp"
#include "line_writer.hpp"

namespace r4::tool {

class SimLog {
 public:
  SimLog(bool json, bool quiet);

  // The callbacks for the board's options; the log must outlive the board.
  sim::SimulatedBoard::Events events();
  // The board they belong to, before its start().
  void watch(const sim::SimulatedBoard& board) { board_ = &board; }

  // Where it listens, known once it has started; events of before are printed behind it.
  void listening(const std::vector<std::string>& urls);

 private:
  Json event(std::uint32_t t_ms) const;
  void on_state(std::uint32_t t_ms, firmware::BoardState state, SafeReason reason);
  void on_outputs(std::uint32_t t_ms, const firmware::Outputs& outputs);
  void on_executed(std::uint32_t t_ms, std::uint32_t pnum, const Command& command);
  void on_refused(std::uint32_t t_ms, std::uint32_t pnum, Refusal code);
  void on_carrier(std::uint32_t t_ms, const Carrier& carrier, const CarrierEvent& event);
  void print(const Json& object) { print(line_of(object)); }
  void print(std::uint32_t t_ms, std::string_view text);
  void print(std::string line);

  bool json_;
  bool quiet_;
  bool started_ = false;
  std::vector<std::string> held_;  // lines of before listening()
  const sim::SimulatedBoard* board_ = nullptr;
  LineWriter writer_;
};

// How a host on this machine opens what a board listens on: "serial:///tmp/r4" for "pty:/tmp/r4".
std::string host_url(const std::string& board_url);

// {"osmc":[[pwm,dir],…],"dhb":…,"servo":[us,…],"relays":bits,"bldc":[[speed,dir,brake],…],
//  "stepper":[[position,speed] or null,…]}
Json outputs_json(const firmware::Outputs& outputs);

// "OSMC1:358,1 SERVO1:2000": what is not off; "all off".
std::string outputs_text(const firmware::Outputs& outputs);

}  // namespace r4::tool
