// SPDX-License-Identifier: GPL-3.0-or-later
// The world around a simulated board of this program, for tests of what drives it:
//
//     r4::sim::SimulatedRobot robot;
//     r4::Board board(robot.url());              // or what your program does with a URL
//     …
//     robot.happen("handle released");           // a line of a scenario, without its time
//     robot.look().pins.osmc[0].pwm              // what the chips do, whatever the state says
//
// Each time its URL is opened the board is switched on afresh, on the bench, and then what has been
// said since it was last open happens. May be used from any thread, also from callbacks of the board.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "carrier.hpp"
#include "config.hpp"
#include "simulated_pins.hpp"
#include "state.hpp"

namespace r4::sim {

class R4LINK_API SimulatedRobot {
 public:
  SimulatedRobot();
  // With a robot of the program's own in place of the vehicle on the bench: it is called on the board's thread, a
  // millisecond at a time, and must outlive every link to it.
  explicit SimulatedRobot(RobotModel& robot);
  ~SimulatedRobot();
  SimulatedRobot(const SimulatedRobot&) = delete;
  SimulatedRobot& operator=(const SimulatedRobot&) = delete;

  // "sim:?robot=1": a board that is in this world, for one link at a time while this object lives.
  const std::string& url() const;

  // Something happens, "us 1 15" (docs/simulation.md has all of them): at once while the board is open, which
  // does not mean before this returns. Throws Error{data} for words that say nothing of the kind.
  void happen(std::string_view words);

  struct Look {
    bool open = false;  // a link to the board is open; if not, this is what was last
    Pins pins;
    bool motors_have_supply = false;
    bool handle_held = true;
    std::int32_t encoder[encoder_channels] = {};   // counts since power came, whatever Z says
    std::int32_t stepper[stepper_channels] = {};   // steps that the motors took since then
    std::int32_t analog_cv[analog_channels] = {};  // hundredths of a volt
  };
  // No older than 10 ms.
  Look look() const;

  class R4LINK_PRIVATE World;

 private:
  R4LINK_PRIVATE explicit SimulatedRobot(RobotModel* robot);
  std::shared_ptr<World> world_;
  std::string url_;
};

// A board behind a bad link, whatever transport it is on:
//
//     r4::Board board(r4::sim::with_link(robot.url(), "loss=5%,delay=20ms±10,seed=7"));
//
// docs/simulation.md has the words; the same seed does the same to the same datagrams at the same times. Throws
// Error{usage} for others. A board that only watches needs a URL of its own for that: `?listen=0` on UDP.
R4LINK_API CarrierMaker with_link(std::string_view url, std::string_view link);

}  // namespace r4::sim
