// SPDX-License-Identifier: GPL-3.0-or-later
// What passes on a transport that a program of this computer holds, for r4 list: as a program that
// watches beside it, which sends nothing (docs/sharing.md).
#pragma once

#include <asio/io_context.hpp>
#include <functional>
#include <utility>

#include "listed_board.hpp"
#include "transports/share/share_client.hpp"
#include "transports/share_name.hpp"

namespace r4::tool {

class HeldTransport final : private ShareClient::Owner {
 public:
  // `board` gets the program that holds the transport, whether that one controls the board, and the
  // board's identity when the board reports it: then `on_news` is called.
  HeldTransport(asio::io_context& io, ListedBoard& board, std::function<void()> on_news)
      : board_(board), on_news_(std::move(on_news)), client_(io, *this) {}

  // False: no program holds it.
  bool join(const ShareName& name);

 private:
  void on_message(const ShareMessage& message) override;
  void on_all_heard() override {}
  void on_no_help(const Problem&) override {}
  void on_closed() override {}

  ListedBoard& board_;
  std::function<void()> on_news_;
  ShareClient client_;
};

}  // namespace r4::tool
