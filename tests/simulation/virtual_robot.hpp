// SPDX-License-Identifier: GPL-3.0-or-later
// A robot, its board and its host in virtual time: the firmware on the models of its chips, the
// shipped session, and a link with delay and loss. One seed gives one run.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "firmware/application/application.hpp"
#include "firmware/ports/sim/simulated_hardware.hpp"
#include "random.hpp"
#include "tests/support/driven_session.hpp"

namespace r4::simulation {

class VirtualRobot final : public firmware::Port, public test::DrivenSession::Handler {
 public:
  using Clock = ReceivedState::Clock;
  struct Link {
    std::uint64_t delay_us = 5000;
    std::uint64_t jitter_us = 2000;  // added to or subtracted from the delay, uniform
    double loss = 0;                 // in each direction
  };

  // `fields`: as in F. `robot`: replaces the vehicle on the bench.
  VirtualRobot(std::uint64_t seed, const Link& link, const std::string& fields,
               sim::RobotModel* robot = nullptr);

  // Waits until the board is ACTIVE under our control and armed.
  bool arm();
  // Advances robot, board, link and host by one millisecond.
  void pass_millisecond();
  void pass(std::uint64_t ms) {
    while (ms-- != 0) pass_millisecond();
  }

  std::function<void(const ReceivedState&)> state_came;
  bool link_cut = false;     // loses everything in both directions
  bool host_lives = true;    // false: the process is killed and sends nothing
  bool states_stop = false;  // only the states of the board are lost

  test::DrivenSession& session() { return session_; }
  Time now() const { return Time{static_cast<std::int64_t>(now_us_)}; }
  Clock::time_point clock() const { return Clock::time_point(now()); }
  double seconds() const { return static_cast<double>(now_us_) / 1e6; }
  sim::BoardModel& model() { return model_; }
  const firmware::Application& application() const { return *application_; }

 private:
  struct Packet {
    std::uint64_t at_us;
    bool to_board;
    std::string bytes;
  };
  void put(bool to_board, std::string_view bytes);
  std::uint32_t board_ms() const { return boot_ms_ + static_cast<std::uint32_t>(now_us_ / 1000); }

  void send(Text datagram, Priority priority, std::uint32_t peer) override;
  std::size_t max_size() const override { return max_datagram; }
  SendResult transmit(std::size_t, std::string_view bytes, Priority priority) override;
  void on_state(const ReceivedState& state, const Datagram& datagram) override;

  Random random_;
  const Link link_;
  const std::uint32_t boot_ms_;
  std::uint64_t now_us_ = 1'000'000;
  std::uint8_t chance_[Authentication::chance_size] = {7};
  std::vector<Packet> packets_;
  sim::BoardModel model_;
  sim::SimulatedHardware hardware_;
  std::unique_ptr<firmware::Application> application_;
  test::DrivenSession session_;
};

}  // namespace r4::simulation
