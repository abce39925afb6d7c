// SPDX-License-Identifier: GPL-3.0-or-later
#include "command_text.hpp"

#include <algorithm>
#include <utility>

#include "r4link/datagram.hpp"
#include "r4link/error.hpp"

namespace r4::tool::ros2 {
namespace {

constexpr std::string_view blank = " \t\r\n";

bool is_ascii(char c) { return (c >= ' ' && c <= '~') || blank.find(c) != std::string_view::npos; }

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
      throw Error(ErrorKind::usage, shown(text), "a topic cannot change settings",
                  "use r4 send URL " + shown(text));
    case CommandKind::fields:  // a stepper without a reported position cannot be stopped
      throw Error(ErrorKind::usage, shown(text), "a topic cannot choose state fields",
                  "choose the fields with --fields");
    case CommandKind::heartbeat:
    case CommandKind::leave:
    case CommandKind::watch:
      throw Error(ErrorKind::usage, shown(text), "is sent by r4 ros2 itself",
                  "leave this command out");
    default:
      break;
  }
}

}  // namespace

std::optional<std::string> text_of(std::string_view bytes) {
  if (bytes.empty() || bytes.size() > max_datagram) return std::nullopt;
  if (bytes.find('\0') != bytes.size() - 1) return std::nullopt;
  bytes.remove_suffix(1);
  return std::string(bytes);
}

bool asks_to_stop(std::string_view text) {
  bool stop = false;
  each_part(text, [&stop](std::string_view part) { stop = stop || part == "E:STOP"; });
  return stop;
}

std::vector<OwnCommand> commands_of(std::string_view text) {
  if (!std::all_of(text.begin(), text.end(), is_ascii)) {  // unreadable in /rosout
    throw Error(ErrorKind::usage, "a command", "has characters that are not ASCII",
                "write the command in ASCII");
  }
  std::vector<OwnCommand> commands;
  each_part(text, [&commands](std::string_view part) {
    OwnCommand command = parse_command_text(part);
    require_allowed(part, command);
    commands.push_back(std::move(command));
  });
  return commands;
}

Problem for_a_node(Problem problem, DisarmCause cause) {
  if (is_earlier(cause)) {
    problem.fix =
        "clear the cause on purpose: send E:CLEAR to R4_Command, or call ~/clear; then arm";
  }
  constexpr std::string_view program("call arm()");
  const std::size_t at = problem.fix.find(program);
  if (at != std::string::npos) {
    problem.fix.replace(at, program.size(), "publish false and then true on arm");
  }
  return problem;
}

}  // namespace r4::tool::ros2
