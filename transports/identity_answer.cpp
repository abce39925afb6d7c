// SPDX-License-Identifier: GPL-3.0-or-later
#include "identity_answer.hpp"

#include <array>
#include <cstddef>

#include "../protocol/messages/message.hpp"
#include "r4link/datagram.hpp"
#include "r4link/messages/datagram_writer.hpp"

namespace r4 {
namespace {

constexpr std::size_t longest_text = 64;

}  // namespace

std::string identity_question() {
  std::array<char, 64> buffer;
  DatagramWriter writer(buffer.data(), buffer.size());
  writer.field("Q").value("ID");
  const Text text = writer.finish();
  return {text.data(), text.size()};
}

std::optional<IdentityAnswer> read_identity_answer(Text bytes) {
  Datagram datagram;
  Identity identity;
  if (!read_datagram(bytes, datagram) || kind_of(datagram) != MessageKind::identity ||
      !read_identity(datagram, identity) || identity.firmware.size() > longest_text ||
      identity.capabilities.size() > longest_text) {
    return std::nullopt;
  }
  const auto str = [](Text text) { return std::string(text.data(), text.size()); };
  IdentityAnswer board;
  board.board_id = str(identity.board_id);
  board.name = str(identity.name);
  board.firmware = str(identity.firmware);
  board.capabilities = str(identity.capabilities);
  if (identity.has_busy) board.busy = identity.busy;
  return board;
}

}  // namespace r4
