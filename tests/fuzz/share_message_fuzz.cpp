// SPDX-License-Identifier: GPL-3.0-or-later
// What another program says to one that holds a wire, or that it holds itself (docs/sharing.md).
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
  require(message->text.size() < size || size == 1);
  // What is said again is the same.
  switch (message->kind) {
    case Kind::hello:
      if (!message->same_version) break;
      require(packet.substr(1) == r4::hello_text(message->role, message->text));
      break;
    case Kind::welcome:
      if (!message->same_version) break;
      require(packet.substr(1) == r4::welcome_text(message->text));
      break;
    case Kind::down:
    case Kind::warning: {
      const std::string again = packet[0] + r4::problem_text(message->problem);
      const auto read = r4::read_share_message(again);
      require(read && read->problem.kind == message->problem.kind);
      break;
    }
    default:
      require(packet.substr(1) == message->text);
      break;
  }
  return 0;
}
