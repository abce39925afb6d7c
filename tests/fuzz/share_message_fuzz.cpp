// SPDX-License-Identifier: GPL-3.0-or-later
// Any messages of another program that shares a transport (docs/how-to/sharing.md).
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>

#include "transports/share/share_message.hpp"

namespace {

void require(bool holds) {
  if (!holds) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using Kind = r4::ShareMessage::Kind;
  const std::string_view packet(reinterpret_cast<const char*>(data), size);
  const auto message = r4::read_share_message(packet);
  if (!message) return 0;
  require(size <= r4::ShareMessage::max_size);
  if (message->kind == Kind::event) {
    const std::string again = packet[0] + r4::text_of(message->event);
    const auto read = r4::read_share_message(again);
    require(read && read->event.kind == message->event.kind &&
            read->event.problem.kind == message->event.problem.kind);
  } else {
    require(packet.substr(1) == message->text);
  }
  return 0;
}
