// SPDX-License-Identifier: GPL-3.0-or-later
#include "share_message.hpp"

namespace r4 {
namespace {

using Kind = ShareMessage::Kind;

constexpr char letter_of(CarrierEvent::Kind kind) {
  return kind == CarrierEvent::Kind::up ? 'u' : kind == CarrierEvent::Kind::down ? 'd' : '!';
}

bool read_event(std::string_view text, CarrierEvent& out) {
  using Event = CarrierEvent::Kind;
  if (text.size() < 2) return false;
  const int kind = text[1] - '0';
  const std::size_t first = text.find('\0', 2);
  const std::size_t second = text.find('\0', first + 1);
  if (kind < static_cast<int>(ErrorKind::data) || kind > static_cast<int>(ErrorKind::unsupported) ||
      first == std::string_view::npos || second == std::string_view::npos) {
    return false;
  }
  out.kind = text[0] == 'u' ? Event::up : text[0] == 'd' ? Event::down : Event::warning;
  // The texts come from another program, and may go to a terminal.
  out.problem = {static_cast<ErrorKind>(kind), printable(text.substr(2, first - 2)),
                 printable(text.substr(first + 1, second - first - 1)),
                 printable(text.substr(second + 1))};
  return letter_of(out.kind) == text[0];
}

}  // namespace

std::optional<ShareMessage> read_share_message(std::string_view packet) {
  if (packet.empty() || packet.size() > ShareMessage::max_size) return std::nullopt;
  ShareMessage message;
  message.kind = static_cast<Kind>(packet[0]);
  message.text = packet.substr(1);
  bool valid = false;
  switch (message.kind) {
    case Kind::hello:
    case Kind::ask:
    case Kind::welcome:
      valid = message.text == ShareMessage::version;
      break;
    case Kind::event:
      valid = read_event(message.text, message.event);
      break;
    case Kind::received:
    case Kind::sent:
    case Kind::oversize:
    case Kind::stop:
      valid = !message.text.empty();
      break;
  }
  return valid ? std::optional(message) : std::nullopt;
}

std::string text_of(const CarrierEvent& event) {
  const auto part = [](const std::string& text) {
    constexpr std::size_t most = (max_datagram - 4) / 3;
    return text.substr(0, most);
  };
  const Problem& problem = event.problem;
  return std::string{letter_of(event.kind),
                     static_cast<char>('0' + static_cast<int>(problem.kind))} +
         part(problem.thing) + '\0' + part(problem.reason) + '\0' + part(problem.fix);
}

}  // namespace r4
