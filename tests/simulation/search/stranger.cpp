// SPDX-License-Identifier: GPL-3.0-or-later
#include "stranger.hpp"

#include "protocol/messages/message.hpp"
#include "protocol/messages/state_fields.hpp"

namespace r4::simulation {
namespace {

// The field of that name with its value, wherever the board has put it.
std::string_view field_in(std::string_view bytes, std::string_view name) {
  for (std::size_t at = bytes.find(name); at != std::string_view::npos;
       at = bytes.find(name, at + 1)) {
    const std::size_t end = bytes.find(';', at);
    if (end != std::string_view::npos && (at == 0 || bytes[at - 1] == ';')) {
      return bytes.substr(at, end + 1 - at);
    }
  }
  return {};
}

}  // namespace

void Stranger::hears(std::string_view bytes) {
  if (const std::string_view id = field_in(bytes, "SID:"); !id.empty()) name_ = id;
  if (const std::string_view cause = field_in(bytes, "CAUSE:"); !cause.empty()) {
    cause_ = static_cast<std::int32_t>(std::stol(std::string(cause.substr(6))));
  }
  Datagram datagram;
  if (!read_datagram(Text(bytes), datagram)) return;
  switch (kind_of(datagram)) {
    case MessageKind::board_heartbeat:
      if (!is_connecting_heartbeat(datagram)) {
        echo_ = static_cast<std::uint32_t>(datagram.time_ms());
      }
      break;
    case MessageKind::nack: {
      Nack nack;
      if (read_nack(datagram, nack) && nack.lease != 0) lease_ = nack.lease;
      break;
    }
    case MessageKind::state: {
      const std::string_view number = field_in(bytes, "CMD:");
      if (!number.empty()) {
        command_ = static_cast<std::uint32_t>(std::stoul(std::string(number.substr(4))));
      }
      break;
    }
    default:
      break;
  }
}

std::uint32_t Stranger::guess(std::uint32_t next) const {
  const bool near = command_ != 0 && next - command_ <= most_guesses;
  return near ? next : command_ + 1;
}

}  // namespace r4::simulation
