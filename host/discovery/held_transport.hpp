// SPDX-License-Identifier: GPL-3.0-or-later
// Watches a board through another program of this computer that holds the transport. Sends nothing
// to the board (docs/how-to/sharing.md).
#pragma once

#include <asio/io_context.hpp>
#include <functional>
#include <utility>

#include "../../transports/identity_answer.hpp"
#include "../../transports/share/share_client.hpp"
#include "../../transports/share_name.hpp"
#include "r4link/discovery/discover.hpp"

namespace r4 {

void take(FoundBoard& board, IdentityAnswer answer);

// True if the board and the holder of the transport have answered.
inline bool is_known(const FoundBoard& board) {
  return board.identity && (!board.holder || !board.holder->name.empty());
}

class HeldTransport final : private ShareClient::Owner {
 public:
  // Fills in the holder and the identity of `board`. Calls `on_news` when the identity arrives.
  HeldTransport(asio::io_context& io, FoundBoard& board, std::function<void()> on_news)
      : board_(board), on_news_(std::move(on_news)), client_(io, *this) {}

  bool join(const ShareName& name);  // false: no program holds the transport

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
