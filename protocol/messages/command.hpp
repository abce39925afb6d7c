// SPDX-License-Identifier: GPL-3.0-or-later
// Every command of the board, typed and checked (paper section 4.2; docs/protocol.md).
//
// The same parser serves the board, the host's `r4 send` text and the tests, so what one side sends
// the other side takes.
#pragma once

#include <cstdint>

#include "../datagram/datagram.hpp"
#include "../datagram/datagram_writer.hpp"
#include "../datagram/refusal.hpp"
#include "state.hpp"
#include "units.hpp"

namespace r4 {

// The value of a host's heartbeat.
constexpr Text host_heartbeat_word("ROS2-R4");

enum class CommandKind : std::uint8_t {
  heartbeat,  // H:ROS2-R4
  osmc,       // O:pwm,dir,ch
  dhb12,      // D:pwm,dir,ch
  servo,      // S:us,ch
  relay,      // R:ch,On|Off
  stop,       // E:STOP
  clear,      // E:CLEAR,cause
  stepper,    // P:pos[,speed],ch
  zero,       // Z:ch
  bldc,       // B:speed,dir,brake,ch
  proximity,  // U:cm,ch
  fields,     // F:name,name…
  setting,    // C:key,value
  identify,   // Q:ID
};

// One command. Which members count depends on `kind`; the factories set them. `text` and `text2`
// are views: they must outlive the command.
struct Command {
  Command() {}  // NOLINT(modernize-use-equals-default): else GCC calls memset for it
  CommandKind kind = CommandKind::heartbeat;
  std::uint8_t channel = 0;  // 1 … the kind's channel count
  std::int32_t value = 0;    // pwm, us, cm, BLDC speed, stepper target; clear: the cause it names
  std::int32_t speed = stepper_speed_default;  // stepper, steps per second
  Direction direction = Direction::reverse;    // osmc, dhb12, bldc
  bool on = false;                             // relay; bldc: brake
  Text text;                                   // fields: the list; setting: the key
  Text text2;                                  // setting: the value

  static Command heartbeat();
  static Command osmc(std::int32_t pwm, Direction direction, int channel);
  static Command dhb12(std::int32_t pwm, Direction direction, int channel);
  static Command servo(std::int32_t us, int channel);
  static Command relay(int channel, bool on);
  static Command stop();
  // `cause`: the number of the cause to be cleared, as the board's heartbeats tell it (CAUSE); 0 if
  // they tell none. unnamed_cause: a host that does not know of such numbers, or Session, which puts
  // the number in.
  static constexpr std::int32_t unnamed_cause = -1;
  static Command clear(std::int32_t cause = unnamed_cause);
  static Command stepper(std::int32_t target_steps, std::int32_t steps_per_s, int channel);
  static Command zero(int channel);
  static Command bldc(std::int32_t speed, Direction direction, bool brake, int channel);
  static Command proximity(std::int32_t cm, int channel);
  static Command fields(Text list);
  static Command setting(Text key, Text value);
  static Command identify();
};

// Does it drive an output? Those are refused in the safe state: O D S R P B Z.
bool drives_output(CommandKind kind);

// Is there E:STOP among its fields? A stop is obeyed whatever else is in its datagram.
bool asks_to_stop(const Datagram& datagram);

// By what number does a stop ask to be confirmed? Its field STOP, else its PNum. False: by none.
constexpr Text stop_number_name("STOP");
bool stop_number(const Datagram& datagram, std::uint32_t& out);

// Reads a command field. Refusal::unknown (no such letter or word), ::format (number of values, an
// empty one, not a whole number), ::channel, ::range (also a number too large for any type), in
// this order; `out` is only written on Refusal::none. Its texts are views of `field`. Ranges of
// settings and names of fields are checked by settings.hpp and parse_fields.
Refusal parse_command(const Field& field, Command& out);

// The ranges that parse_command checks, for a command made by a factory.
Refusal check(const Command& command);

// Appends the command's field: "O:358,1,1;".
void write_command(DatagramWriter& writer, const Command& command);

// `F` values: "DEFAULT", "ALL" or field names, comma-separated. Refusal::unknown for another name.
Refusal parse_fields(Text list, FieldSet& out);

}  // namespace r4
