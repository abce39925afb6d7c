// SPDX-License-Identifier: GPL-3.0-or-later
// The world around a simulated board in this program, for tests of control programs:
//     r4::sim::SimulatedRobot robot;
//     r4::Board board(robot.url());              // or your program with this URL
//     …
//     robot.happen("handle released");           // a line of a scenario, without its time
//     robot.look().pins.osmc[0].pwm              // the chip's output, independent of the state
//
// Each time the URL is opened, the board is switched on anew on the bench. Then events that were
// requested before the opening happen. Thread-safe, also in callbacks of the board.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "carrier.hpp"
#include "config.hpp"
#include "simulation/simulated_pins.hpp"
#include "state.hpp"

namespace r4::sim {

class R4LINK_API SimulatedRobot {
 public:
  SimulatedRobot();
  // A world with a robot model in place of the bench vehicle. The board's thread calls the model
  // once a simulated millisecond. The model must outlive every link.
  explicit SimulatedRobot(RobotModel& robot);
  ~SimulatedRobot();
  SimulatedRobot(const SimulatedRobot&) = delete;
  SimulatedRobot& operator=(const SimulatedRobot&) = delete;

  // "sim:?robot=1": the board in this world, for one link at a time while this object exists.
  const std::string& url() const;

  // Makes an event happen, "us 1 15" (docs/how-to/simulation.md lists all). If the board is open,
  // the event happens soon, perhaps after the return. Throws Error{data} for an unknown event.
  void happen(std::string_view words);

  struct Look {
    bool open = false;  // a link to the board is open; if false, the values below are outdated
    Pins pins;
    bool motors_have_supply = false;
    bool handle_held = true;
    std::int32_t encoder[encoder_channels] = {};   // counts since power-on, not affected by Z
    std::int32_t stepper[stepper_channels] = {};   // steps of the motors since power-on
    std::int32_t analog_cv[analog_channels] = {};  // hundredths of a volt
  };
  // At most 10 ms old.
  Look look() const;

  class R4LINK_PRIVATE World;

 private:
  R4LINK_PRIVATE explicit SimulatedRobot(RobotModel* robot);
  std::shared_ptr<World> world_;
  std::string url_;
};

// A board over a bad link, on any transport:
//     r4::Board board(r4::sim::with_link(robot.url(), "loss=5%,delay=20ms±10,seed=7"));
//
// docs/how-to/simulation.md lists the words; other words throw Error{usage}. A seed has the same
// effect on the same datagrams at the same times. A watcher needs its own URL: `?listen=0` on UDP.
R4LINK_API CarrierMaker with_link(std::string_view url, std::string_view link);

}  // namespace r4::sim
