// SPDX-License-Identifier: GPL-3.0-or-later
#include "share_message.hpp"

#include <algorithm>

namespace r4 {
namespace {

using Kind = ShareMessage::Kind;

// Names come from other programs, and go to a terminal.
bool is_printable(std::string_view text) {
  return std::all_of(text.begin(), text.end(), [](char c) {
    const auto byte = static_cast<unsigned char>(c);
    return byte >= ' ' && byte != 0x7f;
  });
}

bool read_problem(std::string_view text, Problem& out) {
  if (text.empty()) return false;
  const int kind = text[0] - '0';
  if (kind < static_cast<int>(ErrorKind::data) || kind > static_cast<int>(ErrorKind::unsupported)) {
    return false;
  }
  text.remove_prefix(1);
  const std::size_t first = text.find('\0');
  if (first == std::string_view::npos) return false;
  const std::size_t second = text.find('\0', first + 1);
  if (second == std::string_view::npos) return false;
  const std::string_view fix = text.substr(second + 1);
  const std::string_view thing = text.substr(0, first);
  const std::string_view reason = text.substr(first + 1, second - first - 1);
  if (!is_printable(thing) || !is_printable(reason) || !is_printable(fix)) return false;
  out = Problem{static_cast<ErrorKind>(kind), std::string(thing), std::string(reason),
                std::string(fix)};
  return true;
}

bool is_name(std::string_view text) {
  return !text.empty() && text.size() <= ShareMessage::max_name && is_printable(text);
}

}  // namespace

std::optional<ShareMessage> read_share_message(std::string_view packet) {
  if (packet.empty() || packet.size() > ShareMessage::max_size) return std::nullopt;
  ShareMessage message;
  message.kind = static_cast<Kind>(packet[0]);
  std::string_view rest = packet.substr(1);
  switch (message.kind) {
    case Kind::hello:
    case Kind::welcome:
      if (rest.empty()) return std::nullopt;
      message.same_version = rest[0] == ShareMessage::version;
      if (!message.same_version) return message;
      rest.remove_prefix(1);
      if (message.kind == Kind::hello) {
        if (rest.empty() || (rest[0] != 'c' && rest[0] != 'w')) return std::nullopt;
        message.role = rest[0] == 'c' ? BoardRole::control : BoardRole::watch;
        rest.remove_prefix(1);
      }
      [[fallthrough]];
    case Kind::busy:
      if (!is_name(rest)) return std::nullopt;
      break;
    case Kind::yours:
    case Kind::moved:
    case Kind::alive:
      if (!rest.empty()) return std::nullopt;
      break;
    case Kind::up:
      if (rest.empty() || !is_printable(rest)) return std::nullopt;
      break;
    case Kind::down:
    case Kind::warning:
      if (!read_problem(rest, message.problem)) return std::nullopt;
      return message;
    case Kind::received:
    case Kind::sent:
    case Kind::oversize:
    case Kind::stop:
      if (rest.empty()) return std::nullopt;
      break;
    default:
      return std::nullopt;
  }
  message.text = rest;
  return message;
}

std::string hello_text(BoardRole role, std::string_view name) {
  const std::string text = {ShareMessage::version, role == BoardRole::control ? 'c' : 'w'};
  return text + std::string(name.substr(0, ShareMessage::max_name));
}

std::string welcome_text(std::string_view name) {
  return ShareMessage::version + std::string(name.substr(0, ShareMessage::max_name));
}

std::string problem_text(const Problem& problem) {
  const auto part = [](const std::string& text) {
    constexpr std::size_t most = (max_datagram - 3) / 3;
    return text.substr(0, most);
  };
  return static_cast<char>('0' + static_cast<int>(problem.kind)) + part(problem.thing) + '\0' +
         part(problem.reason) + '\0' + part(problem.fix);
}

Priority priority_of(std::string_view datagram) {
  const bool other = datagram.size() > 1 && datagram[1] == ':' &&
                     (datagram[0] == 'H' || datagram[0] == 'N' || datagram[0] == 'I');
  return other ? Priority::normal : Priority::state;
}

}  // namespace r4
