// SPDX-License-Identifier: GPL-3.0-or-later
#include "command_text.hpp"

#include <cstring>

#include "host/commands/command_help.hpp"
#include "r4link/datagram.hpp"
#include "r4link/error.hpp"

namespace r4::tool::ros2 {
namespace {

constexpr std::string_view blank = " \t\r\n";

// Calls part(text) for each that is not empty.
template <class Part>
void each_part(std::string_view text, Part part) {
  while (!text.empty()) {
    const std::size_t end = text.find(';');
    std::string_view one = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    const std::size_t first = one.find_first_not_of(blank);
    if (first == std::string_view::npos) continue;
    one.remove_prefix(first);
    one.remove_suffix(one.size() - one.find_last_not_of(blank) - 1);
    part(one);
  }
}

void require_allowed(std::string_view text, const Command& command) {
  switch (command.kind) {
    case CommandKind::setting:
      throw Error(ErrorKind::usage, shown(text), "settings are not taken from a topic",
                  "r4 send URL " + shown(text) + " sets it");
    case CommandKind::fields:  // a stepper whose position is not told cannot be stopped
      throw Error(ErrorKind::usage, shown(text), "fields are not chosen from a topic",
                  "name them by --fields");
    case CommandKind::heartbeat:
    case CommandKind::leave:
    case CommandKind::watch:
      throw Error(ErrorKind::usage, shown(text), "is said by r4 ros2 itself", "leave it out");
    default:
      break;
  }
}

}  // namespace

std::optional<std::string> text_of(const dds_sequence_octet& string) {
  const std::uint32_t length = string._length;
  if (length == 0 || length > max_datagram || string._buffer[length - 1] != 0) {
    return std::nullopt;
  }
  const auto* const bytes = reinterpret_cast<const char*>(string._buffer);
  if (std::memchr(bytes, 0, length - 1) != nullptr) return std::nullopt;
  return std::string(bytes, length - 1);
}

bool asks_to_stop(std::string_view text) {
  bool stop = false;
  each_part(text, [&stop](std::string_view part) { stop = stop || part == "E:STOP"; });
  return stop;
}

std::vector<Command> commands_of(std::string_view text) {
  std::vector<Command> commands;
  each_part(text, [&commands](std::string_view part) {
    const Command command = parse_command_text(part);
    require_allowed(part, command);
    commands.push_back(command);
  });
  return commands;
}

}  // namespace r4::tool::ros2
