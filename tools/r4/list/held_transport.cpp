// SPDX-License-Identifier: GPL-3.0-or-later
#include "held_transport.hpp"

#include <optional>

#include "r4link/datagram.hpp"

namespace r4::tool {

bool HeldTransport::join(const ShareName& name) {
  for (const BoardRole role : {BoardRole::control, BoardRole::watch}) {
    if (client_.join(name, role, ShareMessage::Kind::hello, "") != ShareClient::Joined::holder) {
      continue;
    }
    board_.pid = client_.process();
    board_.controls = role == BoardRole::control;
    return true;
  }
  return false;
}

void HeldTransport::on_message(const ShareMessage& message) {
  if (message.kind == ShareMessage::Kind::welcome) board_.program = program_of(board_.pid);
  if (message.kind != ShareMessage::Kind::received) return;
  if (auto identity = read_identity_answer(Text(message.text.data(), message.text.size()))) {
    board_.identity = std::move(identity);
    on_news_();
  }
}

}  // namespace r4::tool
