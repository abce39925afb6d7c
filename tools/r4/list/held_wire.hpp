// SPDX-License-Identifier: GPL-3.0-or-later
// What passes on a wire that a program of this machine holds, for r4 list: as one that watches beside it, which
// sends nothing (docs/sharing.md).
#pragma once

#include <asio/io_context.hpp>
#include <functional>
#include <utility>

#include "listed_board.hpp"
#include "transports/share/wire_sharer.hpp"
#include "transports/shared_wire.hpp"

namespace r4::tool {

class HeldWire final : private WireSharer::Owner {
 public:
  // `board` is told who holds the wire, whether that one controls the board, and who the board is when it says so.
  // `on_news` is called then.
  HeldWire(asio::io_context& io, ListedBoard& board, std::function<void()> on_news)
      : board_(board), on_news_(std::move(on_news)), sharer_(io, *this) {}

  // False: nobody holds it.
  bool join(const SharedWire& wire);

 private:
  void on_message(const ShareMessage& message) override;
  void on_all_heard() override {}
  void on_holder_lost() override {}

  ListedBoard& board_;
  std::function<void()> on_news_;
  WireSharer sharer_;
};

}  // namespace r4::tool
