// SPDX-License-Identifier: GPL-3.0-or-later
// Any ROS message: a string of R4_Command and ~/send, or the numbers of the other topics. The
// message is refused with a reason, or it gives commands that the board accepts and that a topic
// may send.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "input.hpp"
#include "r4link/commands/command_text.hpp"
#include "r4link/error.hpp"
#include "tools/r4/ros2/command_text.hpp"
#include "tools/r4/ros2/setpoint_units.hpp"

namespace r4::tool::ros2 {
namespace {

bool is_ascii(char c) { return static_cast<unsigned char>(c) < 0x80; }

void is_sendable(const Command& command) {
  require(check_command(command) == Refusal::none);
  for (const CommandKind kind : {CommandKind::heartbeat, CommandKind::leave, CommandKind::watch,
                                 CommandKind::setting, CommandKind::fields}) {
    require(command.kind != kind);
  }
  const std::string text = to_text(command);
  const OwnCommand again = parse_command_text(text);
  require(to_text(again) == text);
}

void read_string(std::string_view bytes) {
  const std::optional<std::string> text = text_of(bytes);
  if (!text) return;
  require(text->size() + 1 == bytes.size());
  const bool stops = asks_to_stop(*text);
  try {
    bool stop = false;
    for (const OwnCommand& own : commands_of(*text)) {
      const Command command = own;
      is_sendable(command);
      stop = stop || command.kind == CommandKind::stop;
    }
    require(stop == stops);
  } catch (const Error& error) {
    const Problem& problem = error.problem();
    require(problem.kind == ErrorKind::usage && !problem.reason.empty() && !problem.fix.empty());
    // This text is published on /rosout.
    require(std::all_of(problem.thing.begin(), problem.thing.end(), is_ascii));
  }
}

void read_numbers(double first, double second) {
  const Duty duty(first);
  require(duty.is_in_range() == (first >= -1 && first <= 1));
  if (duty.is_in_range()) require(duty.pwm().value >= 0 && duty.pwm().value <= 4095);
  const MotorChannel left{CommandKind::osmc, 1, false}, right{CommandKind::dhb12, 4, true};
  if (const auto command = left.command(first)) is_sendable(*command);
  for (const char* unit : {"us", "500,2500,3.14159265358979"}) {
    if (const auto pulse = to_pulse(servo_unit(unit), first))
      is_sendable(Command::servo(16, *pulse));
  }
  const auto wheels = DifferentialDrive{left, right, 0.4, 1.5}.setpoints(first, second);
  if (std::isnan(first) || std::isnan(second)) require(!wheels);
  for (std::size_t i = 0; wheels && i < wheels->size(); ++i) is_sendable((*wheels)[i]);
}

}  // namespace
}  // namespace r4::tool::ros2

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  namespace ros2 = r4::tool::ros2;
  double numbers[2];
  if (size < sizeof numbers) return 0;
  std::memcpy(numbers, data, sizeof numbers);
  ros2::read_numbers(numbers[0], numbers[1]);
  float floats[2];
  std::memcpy(floats, data, sizeof floats);
  ros2::read_numbers(floats[0], floats[1]);
  ros2::read_string({reinterpret_cast<const char*>(data) + sizeof numbers, size - sizeof numbers});
  return 0;
}
