// SPDX-License-Identifier: GPL-3.0-or-later
// A simulated board with an event loop and a thread of its own, for hosts in the test's thread.
#pragma once

#include <asio/io_context.hpp>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "firmware/ports/sim/simulated_board.hpp"
#include "r4link/board.hpp"
#include "transports/file_descriptor.hpp"

namespace r4::test {

class BoardInAThread {
 public:
  // What it listens on: "udp" (a free port of this machine), "pty", or a URL of a CAN bus. `script`:
  // what happens to it (firmware/ports/sim/script.hpp).
  explicit BoardInAThread(const std::string& transport, const std::string& script = "")
      : BoardInAThread(std::vector<std::string>{transport}, script) {}
  // On several at once.
  explicit BoardInAThread(const std::vector<std::string>& transports,
                          const std::string& script = "",
                          const std::string& board_id = "test-board");
  ~BoardInAThread();
  BoardInAThread(const BoardInAThread&) = delete;
  BoardInAThread& operator=(const BoardInAThread&) = delete;

  // The URL by which a host reaches it.
  const std::string& url() const { return urls_[0]; }
  const std::vector<std::string>& urls() const { return urls_; }

  // Switches it off; the transport disappears.
  void switch_off();

  // Does `action` on the board's thread.
  void run(const std::function<void(sim::SimulatedBoard&)>& action);

  // True if the board is safe because it has no host, and motor 1 is off.
  bool is_without_host();

  // What the board has executed so far, "O:358,1,1".
  std::vector<std::string> executed();
  // Waits for the board to enter that state; false after 5 s.
  bool wait_for(firmware::BoardState state, SafeReason reason = SafeReason::none);

 private:
  asio::io_context io_;
  std::vector<std::string> urls_;
  std::vector<FileDescriptor> ptys_;  // kept open
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<std::string> executed_;
  firmware::BoardState state_ = firmware::BoardState::connecting;
  SafeReason reason_ = SafeReason::none;
  std::unique_ptr<sim::SimulatedBoard> board_;
  std::thread thread_;
};

// Waits until a host has heard that its board is safe for that reason; false after 5 s. What it
// asks before may be cancelled by the news.
bool hears_of(const Board& host, SafeReason reason);

}  // namespace r4::test
