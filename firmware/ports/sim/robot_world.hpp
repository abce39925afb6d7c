// SPDX-License-Identifier: GPL-3.0-or-later
// The state that a SimulatedRobot shares with the board of its URL, which runs on another thread.
#pragma once

#include <asio/io_context.hpp>
#include <memory>
#include <mutex>
#include <vector>

#include "r4link/simulation.hpp"
#include "simulated_board.hpp"

namespace r4::sim {

class SimulatedRobot::World : public std::enable_shared_from_this<World> {
 public:
  explicit World(RobotModel* robot) : robot_(robot) {}
  // The world of `robot=N` in this process; empty if its robot is destroyed.
  static std::shared_ptr<World> find(long number);
  static long enter(const std::shared_ptr<World>& world);

  // --- from any thread
  void happen(ScriptStep step);
  Look look() const;

  // --- from the board's thread
  // Throws Error{open} if the robot has another board.
  void attach(asio::io_context& io, SimulatedBoard& board);
  void detach() noexcept;
  void note();
  // Carries out the steps of happen(), if the board is on `io`. Call on the thread of `io`.
  void settle(const asio::io_context& io);

 private:
  RobotModel* const robot_;  // nullptr: the vehicle on the bench
  mutable std::mutex mutex_;
  asio::io_context* io_ = nullptr;  // the board's loop, while the board is open
  SimulatedBoard* board_ = nullptr;
  std::vector<ScriptStep> said_;
  Look look_;
};

}  // namespace r4::sim
