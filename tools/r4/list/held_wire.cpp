// SPDX-License-Identifier: GPL-3.0-or-later
#include "held_wire.hpp"

#include <cerrno>
#include <optional>

#include "protocol/messages/message.hpp"
#include "r4link/datagram.hpp"

namespace r4::tool {
namespace {

bool is_host_heartbeat(std::string_view bytes) {
  Datagram datagram;
  return read_datagram(Text(bytes.data(), bytes.size()), datagram) &&
         kind_of(datagram) == MessageKind::host_heartbeat;
}

}  // namespace

bool HeldWire::join(const SharedWire& wire) {
  // Those behind have come because one before hangs.
  int place = share_places;
  do {
    if (place-- == 0) return false;
  } while (sharer_.join(at_place(wire, place), BoardRole::watch, program_invocation_short_name) !=
           WireSharer::Joined::holder);
  board_.pid = sharer_.holder_pid();
  sharer_.listen();
  return true;
}

void HeldWire::on_message(const ShareMessage& message) {
  switch (message.kind) {
    case ShareMessage::Kind::welcome:
      board_.program = message.text;
      break;
    case ShareMessage::Kind::received:
      if (std::optional<IdentityAnswer> identity =
              read_identity_answer(Text(message.text.data(), message.text.size()))) {
        board_.identity = std::move(identity);
        on_news_();
      }
      break;
    case ShareMessage::Kind::sent:  // by the holder: others may only stop
      if (!board_.controls && is_host_heartbeat(message.text)) {
        board_.controls = true;
        on_news_();
      }
      break;
    default:
      break;
  }
}

}  // namespace r4::tool
