// SPDX-License-Identifier: GPL-3.0-or-later
#include "held_transport.hpp"

#include <optional>

#include "r4link/datagram.hpp"

namespace r4 {

void take(FoundBoard& board, IdentityAnswer answer) {
  // An answer to the controlling holder reports only that no other host is in control.
  if (!board.holder_controls) board.busy = answer.busy;
  board.identity = std::move(answer);
}

bool HeldTransport::join(const ShareName& name) {
  for (const BoardRole role : {BoardRole::control, BoardRole::watch}) {
    if (client_.join(name, role, ShareMessage::Kind::hello) != ShareClient::Joined::holder) {
      continue;
    }
    if (client_.process() != 0) board_.holder = Program{client_.process(), ""};
    board_.holder_controls = role == BoardRole::control;
    if (board_.holder_controls) board_.busy = true;
    return true;
  }
  return false;
}

void HeldTransport::on_message(const ShareMessage& message) {
  if (message.kind == ShareMessage::Kind::welcome && board_.holder) {
    board_.holder->name = program_of(board_.holder->pid);
  }
  if (message.kind != ShareMessage::Kind::received) return;
  if (auto answer = read_identity_answer(Text(message.text.data(), message.text.size()))) {
    take(board_, std::move(*answer));
    on_news_();
  }
}

}  // namespace r4
