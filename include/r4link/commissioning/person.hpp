// SPDX-License-Identifier: GPL-3.0-or-later
// The person at the board during a commissioning: reads, answers, and holds a key during a
// movement. r4 commission uses a terminal or JSON lines; tests use a simulated person.
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
  wheels_off_ground,         // yes: the wheels are off the ground, and no person touches the motors
  clear,                     // yes: the fault of an unconfirmed wiring may be cleared
  restart,                   // yes: the reset button was pressed
  address_seen,              // number: the address at which a chip answers; 0: no answer
  meter,                     // number: volts at an analog input
  handle_held,               // yes: the dead-man's handle is held
  handle_released,           // yes: the handle is released
  wheel_turned,              // yes: the wheel of an encoder was turned forward, once
  hand_before_sensor,        // yes: a hand is about 20 cm before the sensor
  hand_away,                 // yes: nothing is nearer than 1 m
  baud,                      // number: baud rate of the device at a UART; 0: no device
  supply_with_relay_open,    // yes: a meter shows the motor supply at the drivers
  supply_with_relay_closed,  // yes: a meter showed the motor supply while the key was held
  which,                     // choice: the part that has moved or clicked
  forward,                   // yes: the part moved forward
  two_pwm_inputs,            // yes: the driver has an input for each direction
  servo_supply,              // yes: a meter shows 5 V at the servo's header
  give_wiring,               // yes: the board may keep the wiring
  give_settings,             // yes: the board may keep the learnt full scales
};
// The enumerator's name with spaces: "supply off", "wheels off ground" …
R4LINK_API const char* to_text(Topic topic);

struct Question {
  enum class Kind : std::uint8_t { yes_no, number, choice };
  Topic topic;
  Kind kind = Kind::yes_no;
  std::string check{};  // id of the check, "osmc 1"
  std::string text{};
  std::vector<std::string> choices{};  // for a choice
  std::string unit{};                  // for a number
};

struct Answer {
  enum class Kind : std::uint8_t {
    given,
    skip,
    repeat,  // from the beginning of the check
    leave,   // to resume the commissioning later
  };
  Kind kind = Kind::given;
  bool yes = false;
  double number = 0;
  std::size_t choice = 0;  // index in Question::choices
};

// A movement while the person holds the key.
struct Movement {
  std::string check;
  std::string text;
  Command command;                 // for the output; relay 1 closes before
  std::chrono::milliseconds most;  // longest time
};

class R4LINK_API Person {
 public:
  virtual void say(std::string_view check, std::string_view text) = 0;
  virtual Answer ask(const Question& question) = 0;
  // Announces the movement, and waits until the person holds the key. `given`: the key is held.
  virtual Answer await_key(const Movement& movement) = 0;
  // False as soon as the person releases the key. Must not wait.
  virtual bool holds_key() = 0;

 protected:
  ~Person() = default;
};

}  // namespace r4::commissioning
