// SPDX-License-Identifier: GPL-3.0-or-later
// A simulated board with its own event loop and thread, for hosts in the thread of the test.
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
  // `transport`: "udp" (a free port on loopback), "pty", or the URL of a CAN bus. `script`: events
  // of the simulation (firmware/ports/sim/script.hpp).
  explicit BoardInAThread(const std::string& transport, const std::string& script = "")
      : BoardInAThread(std::vector<std::string>{transport}, script) {}
  explicit BoardInAThread(const std::vector<std::string>& transports,
                          const std::string& script = "",
                          const std::string& board_id = "test-board");
  ~BoardInAThread();
  BoardInAThread(const BoardInAThread&) = delete;
  BoardInAThread& operator=(const BoardInAThread&) = delete;

  const std::string& url() const { return urls_[0]; }
  const std::vector<std::string>& urls() const { return urls_; }

  // Switches the board off, so that its transport disappears.
  void switch_off();

  void run(const std::function<void(sim::SimulatedBoard&)>& action);

  // True if the board is safe because it has no host, and motor 1 is off.
  bool is_without_host();

  // The commands that the board has executed so far, "O:358,1,1".
  std::vector<std::string> executed();
  // Waits until the board enters the given state. False after 5 s.
  bool wait_for(firmware::BoardState state, SafeReason reason = SafeReason::none);

 private:
  asio::io_context io_;
  std::vector<std::string> urls_;
  std::vector<FileDescriptor> ptys_;  // kept open
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<std::string> executed_;
  firmware::BoardState state_ = firmware::BoardState::connecting;
  SafeReason reason_ = SafeReason::link;
  std::unique_ptr<sim::SimulatedBoard> board_;
  std::thread thread_;
};

// Waits until `host` reports that its board is safe for the given reason. False after 5 s. The
// change may cancel commands of the host that are under way.
bool hears_of(const Board& host, SafeReason reason);

}  // namespace r4::test
