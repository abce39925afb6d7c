// SPDX-License-Identifier: GPL-3.0-or-later
#include "monitor_boards.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <asio/io_context.hpp>
#include <asio/steady_timer.hpp>
#include <chrono>
#include <memory>
#include <utility>

#include "../shell/line_writer.hpp"
#include "../shell/paths.hpp"
#include "../shell/run_end.hpp"
#include "../shell/screen.hpp"
#include "monitor_view.hpp"
#include "r4link/async_board.hpp"
#include "r4link/error.hpp"
#include "r4link/link.hpp"

namespace r4::tool {
namespace {

constexpr std::size_t unread_of_boards = std::size_t{1} << 18;  // bytes that wait for a reader
constexpr Milliseconds interval{1000};
// With --count alone: how long all may stay silent from the start.
constexpr Milliseconds boards_patience{5000};
constexpr Milliseconds farewell{100};

// A board with what is shown of it.
struct ShownBoard {
  ShownBoard(asio::io_context& io, const std::string& board_url, const BoardOptions& options)
      : url(board_url), board(io, board_url, options) {}

  std::string url;
  AsyncBoard board;
  std::unique_ptr<MonitorView> view;  // of its JSON
  std::string note;                   // of its transport
};

// "; udp://10.0.0.7:2018: silent", of several those that do not carry.
std::string lost_paths(const AsyncBoard& board) {
  const std::vector<PathStatus> paths = board.paths();
  std::string text;
  for (const PathStatus& path : paths) {
    if (paths.size() < 2 || path.state == PathState::carrying) continue;
    text += fmt::format("; {}: {}", path.name, to_text(path.state));
  }
  return text;
}

class BoardsMonitor {
 public:
  explicit BoardsMonitor(const BoardsMonitorOptions& options)
      : options_(options),
        run_end_(io_),
        tick_(io_),
        end_(io_),
        live_(!options.json && ::isatty(STDOUT_FILENO) != 0) {
    for (const std::string& url : options.urls) {
      boards_.push_back(std::make_unique<ShownBoard>(io_, url, options.board));
    }
  }

  void run() {
    for (const auto& board : boards_) {
      listen(*board);
      board->board.open();
    }
    run_end_.watch();
    end_.expires_after(options_.duration.value_or(boards_patience));
    end_.async_wait([this](const std::error_code& error) {
      if (!error && (options_.duration || (options_.count != 0 && states_ == 0))) io_.stop();
    });
    next_tick();
    io_.run();
    show();
    leave();
    for (const auto& board : boards_) {
      require_one_board(board->board);
      if (board->board.statistics().received != 0) continue;
      Problem problem = explain(board->url, board->board.link());
      problem.thing = board->url;
      throw Error(std::move(problem));
    }
  }

 private:
  void listen(ShownBoard& one) {
    AsyncBoard& board = one.board;
    if (options_.json) {
      one.view = make_json_view(board, lines_);
      MonitorView& view = *one.view;
      board.on_board_heartbeat([&view](const Datagram& d) { view.on_heartbeat(d); });
      board.on_nack([&view](const Nack& nack, const Datagram& d) { view.on_nack(nack, d); });
      board.on_bad_datagram([&view](const ReadResult& result, std::string_view bytes) {
        view.on_bad_datagram(result, bytes);
      });
      board.on_link([&view](const LinkStatus& status) { view.on_link(status); });
      on_paths(board, [&view](const PathStatus& path) { view.on_path(path); });
    }
    board.on_state([this, &one](const ReceivedState& state, const Datagram& datagram) {
      if (io_.stopped()) return;  // what came together with the last one
      if (one.view) one.view->on_state(state, datagram);
      if (++states_ == options_.count) io_.stop();
    });
    board.on_event([&one](const CarrierEvent& event) {
      if (one.view) one.view->on_event(event);
      one.note = event.kind == CarrierEvent::Kind::up ? "" : event.problem.reason;
    });
  }

  void next_tick() {
    tick_.expires_after(interval);
    tick_.async_wait([this](const std::error_code& error) {
      if (error) return;
      show();
      next_tick();
    });
  }

  void show() {
    if (options_.json || (live_ && !Screen::has_room())) return;
    if (live_) {
      screen_.draw(table());
    } else {
      for (const std::string& row : table()) lines_.write(row + "\n");
    }
  }

  // Who is not well comes first on a screen, which may be too short for all.
  std::vector<std::string> table() const {
    std::size_t width = 5;
    std::size_t active = 0;
    double rate = 0;
    std::vector<std::pair<bool, std::string>> rows;
    for (const auto& one : boards_) width = std::max(width, one->url.size());
    for (const auto& one : boards_) {
      const LinkStatus& link = one->board.link();
      const Statistics statistics = one->board.statistics();
      const bool well = link.state == HostLinkState::active;
      active += well ? 1 : 0;
      rate += statistics.state_rate_hz;
      rows.emplace_back(
          well, fmt::format("{:<{}}  {:>7.1f} {:>8} {:>8}  {}{}{}{}", one->url, width,
                            statistics.state_rate_hz, statistics.packets.lost, statistics.damaged,
                            link_text(link), one->note.empty() ? "" : "; ", one->note,
                            lost_paths(one->board)));
    }
    if (live_) {
      std::stable_partition(rows.begin(), rows.end(), [](const auto& row) { return !row.first; });
    }
    std::vector<std::string> lines{
        fmt::format("{} boards, {} active, {:.0f} states a second{}", boards_.size(), active, rate,
                    live_ ? "   (Ctrl-C ends)" : ""),
        fmt::format("{:<{}}  {:>7} {:>8} {:>8}  {}", "board", width, "Hz", "lost", "damaged",
                    "link")};
    for (auto& [well, text] : rows) lines.push_back(std::move(text));
    return lines;
  }

  // All say farewell at once.
  void leave() {
    std::size_t left = boards_.size();
    for (const auto& board : boards_) {
      board->board.async_close(farewell, [this, &left](const CommandResult&) {
        if (--left == 0) io_.stop();
      });
    }
    tick_.cancel();
    end_.cancel();
    io_.restart();
    io_.run();
  }

  const BoardsMonitorOptions& options_;
  asio::io_context io_{1};
  RunEnd run_end_;
  asio::steady_timer tick_;
  asio::steady_timer end_;
  const bool live_;
  LineWriter lines_{unread_of_boards};
  Screen screen_;
  std::vector<std::unique_ptr<ShownBoard>> boards_;
  std::uint64_t states_ = 0;
};

}  // namespace

void monitor_boards(const BoardsMonitorOptions& options) { BoardsMonitor(options).run(); }

}  // namespace r4::tool
