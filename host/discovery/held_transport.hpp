// SPDX-License-Identifier: GPL-3.0-or-later
// Listens beside a program of this computer that holds a transport, as a program that watches. It
// sends nothing to the board (docs/sharing.md).
#pragma once

#include <asio/io_context.hpp>
#include <functional>
#include <utility>

#include "../../transports/identity_answer.hpp"
#include "../../transports/share/share_client.hpp"
#include "../../transports/share_name.hpp"
#include "r4link/discovery/discover.hpp"

namespace r4 {

// Puts the board's answer into `board`.
void take(FoundBoard& board, IdentityAnswer answer);

// True if the board and the program that holds the transport have answered.
inline bool is_known(const FoundBoard& board) {
  return board.identity && (!board.holder || !board.holder->name.empty());
}

class HeldTransport final : private ShareClient::Owner {
 public:
  // `board` gets its holder, and its identity when the board reports it: then `on_news` is called.
  HeldTransport(asio::io_context& io, FoundBoard& board, std::function<void()> on_news)
      : board_(board), on_news_(std::move(on_news)), client_(io, *this) {}

  // False: no program holds it.
  bool join(const ShareName& name);

 private:
  void on_message(const ShareMessage& message) override;
  void on_all_heard() override {}
  void on_no_help(const Problem&) override {}
  void on_closed() override {}

  FoundBoard& board_;
  std::function<void()> on_news_;
  ShareClient client_;
};

}  // namespace r4
