// SPDX-License-Identifier: GPL-3.0-or-later
// The boards of a command on one event loop. Order of calls: on_state() of each board, open(),
// end_by_signal(), run() until a signal, the duration or stop(), leave(), require_heard().
#pragma once

#include <asio/io_context.hpp>
#include <chrono>
#include <cstddef>
#include <deque>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "r4link/async_board.hpp"
#include "r4link/devices/device.hpp"
#include "r4link/discovery/url_pattern.hpp"
#include "run_end.hpp"

namespace r4::tool {

struct SetBoard {
  SetBoard(asio::io_context& io, std::size_t board_index, std::string board_url,
           const BoardOptions& options)
      : index(board_index), url(std::move(board_url)), board(io, url, options) {}

  const std::size_t index;  // from 0, in the order of the URLs
  const std::string url;    // as given by the user
  AsyncBoard board;
};

class BoardSet {
 public:
  BoardSet() = default;
  // Throws Error{usage} for a wrong URL or pattern.
  BoardSet(const std::vector<std::string>& patterns, const BoardOptions& options);

  // Does not open the board, even if the boards of the set are already open.
  SetBoard& add(const std::string& url, const BoardOptions& options);

  asio::io_context& io() { return io_; }
  std::size_t size() const { return boards_.size(); }
  SetBoard& operator[](std::size_t board) { return boards_[board]; }
  auto begin() { return boards_.begin(); }
  auto end() { return boards_.end(); }
  auto begin() const { return boards_.begin(); }
  auto end() const { return boards_.end(); }

  // Throws Error for the first board that cannot be opened.
  void open();
  void end_by_signal(const std::optional<std::chrono::milliseconds>& duration = std::nullopt) {
    end_.watch(duration);
  }
  void run() { io_.run(); }
  void raise_signal_again() { end_.raise_again(); }
  // Ends run(). Callbacks for datagrams from the same read may follow.
  void stop() { io_.stop(); }
  bool stopped() const { return io_.stopped(); }
  // After run(): disconnects all boards and waits up to `limit`, to spare the next command a wait.
  void leave(std::chrono::milliseconds limit = std::chrono::milliseconds{100});

  // Throws Error{refused} for the first board that was not heard or whose paths lead to two boards.
  void require_heard() const;

 private:
  asio::io_context io_{1};
  RunEnd end_{io_};
  std::deque<SetBoard> boards_;
};

// Options of a watcher. Empty `fields`: DEFAULT. The fields of `devices` are added.
BoardOptions watching(const std::string& key, const std::string& fields = {},
                      const std::vector<Device>& devices = {});
void ask_for(BoardOptions& options, const std::string& fields, const std::vector<Device>& devices);

// "can0" for can://can0 without a node, which means every board heard on the bus; else empty.
std::string whole_bus(std::string_view url);

}  // namespace r4::tool
