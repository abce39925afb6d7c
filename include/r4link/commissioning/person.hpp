// SPDX-License-Identifier: GPL-3.0-or-later
// The person at a board that is commissioned: reads, answers, and holds a key while something
// moves. r4 commission asks in a terminal or by JSON lines; tests have a simulated person.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "../command.hpp"
#include "../config.hpp"

namespace r4::commissioning {

// The subject of a question, for scripts.
enum class Topic : std::uint8_t {
  supply_off,                // yes: the motors have no supply
  wheels_off_ground,         // yes: the wheels are off the ground, and nobody touches the motors
  clear,                     // yes: the fault of a wiring that nobody has confirmed may be cleared
  restart,                   // yes: the reset button was pressed
  address_seen,              // number: the address at which a chip answers; 0: it does not
  meter,                     // number: volts at an analog input
  handle_held,               // yes: the dead-man's handle is held
  handle_released,           // yes: it was let go
  wheel_turned,              // yes: the wheel of an encoder was turned forward, once
  hand_before_sensor,        // yes: a hand is about 20 cm before the sensor
  hand_away,                 // yes: nothing is nearer than 1 m
  baud,                      // number: speed of the device at a UART; 0: there is none
  supply_with_relay_open,    // yes: a meter shows the motors' supply at the drivers
  supply_with_relay_closed,  // yes: it showed the supply while the key was held
  which,                     // choice: what has moved or clicked
  forward,                   // yes: it went forward
  two_pwm_inputs,            // yes: the driver has an input for each direction
  servo_supply,              // yes: a meter shows 5 V at the servo's header
  give_wiring,               // yes: the board may keep the wiring
  give_settings,             // yes: the board may keep the full scales
};
// "supply off", "wheels off ground" …: the names above, with spaces.
R4LINK_API const char* to_text(Topic topic);

struct Question {
  enum class Kind : std::uint8_t { yes_no, number, choice };
  Topic topic;
  Kind kind = Kind::yes_no;
  std::string check{};  // its id, "osmc 1"
  std::string text{};
  std::vector<std::string> choices{};  // for a choice
  std::string unit{};                  // for a number
};

struct Answer {
  enum class Kind : std::uint8_t {
    given,
    skip,    // this check
    repeat,  // this check, from its beginning
    leave,   // the commissioning, to resume it later
  };
  Kind kind = Kind::given;
  bool yes = false;
  double number = 0;
  std::size_t choice = 0;  // index in Question::choices
};

// Something that will move while the person holds the key.
struct Movement {
  std::string check;
  std::string text;
  Command command;                 // of the output; relay 1 closes before it
  std::chrono::milliseconds most;  // it ends by then
};

class R4LINK_API Person {
 public:
  virtual void say(std::string_view check, std::string_view text) = 0;
  // Waits for the answer.
  virtual Answer ask(const Question& question) = 0;
  // Announces, and waits until the person holds the key. `given`: the key is held.
  virtual Answer await_key(const Movement& movement) = 0;
  // False as soon as the person lets go. Must not wait.
  virtual bool holds_key() = 0;

 protected:
  ~Person() = default;
};

}  // namespace r4::commissioning
