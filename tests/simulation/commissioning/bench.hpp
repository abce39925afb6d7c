// SPDX-License-Identifier: GPL-3.0-or-later
// A simulated board on its own cable, in virtual time. Waiting advances the time. The bench counts
// the milliseconds in which an output was on without an announcement.
#pragma once

#include <asio/io_context.hpp>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "firmware/ports/sim/simulated_board.hpp"
#include "r4link/commissioning/board_under_test.hpp"
#include "tests/simulation/random.hpp"
#include "tests/support/driven_session.hpp"

namespace r4::simulation {

class Bench final : public commissioning::BoardUnderTest, private test::DrivenSession::Handler {
 public:
  struct Options {
    Wiring wired = plan_wiring();       // the board's real wiring
    bool new_board = false;             // the plan is not confirmed
    bool knows_wiring = false;          // the board has its real wiring in its settings
    std::vector<std::string> broken{};  // words of a scenario
    bool papers_firmware = false;       // does not report its identity
  };
  explicit Bench(const Options& options);

  void pass(std::uint32_t ms);
  void happen(const std::string& words);
  sim::BoardModel& model() { return board_.model(); }
  std::uint32_t now_ms() const { return static_cast<std::uint32_t>(now_.count() / 1000); }

  std::function<void()> on_millisecond;
  bool link_cut = false;

  void wait_heard() override;
  std::optional<ReceivedState> next_state(Duration timeout) override;
  void forget_states() override { states_.clear(); }
  LinkStatus link() override { return session_.link(); }
  BoardIdentity identify() override;
  BoardWiring wiring() override;
  void give_wiring(const Wiring& wiring) override;
  std::vector<std::uint8_t> scan() override;
  void send(const Command& command, Duration timeout) override;
  void arm() override;
  void stop() override { send(Command::stop(), patience); }
  void supervise(bool supervised) override;
  void be_silent(bool silent) override;
  std::vector<std::string> transports() override { return {"cable"}; }
  Quality measure(std::size_t transport, Duration time) override;
  void stop_over(std::size_t) override { stop(); }

 private:
  class Cable;
  static constexpr Duration patience{1000};

  void pass_millisecond();
  void set_watchdog();
  CommandResult result_of(Ticket ticket);
  SendResult transmit(std::size_t, std::string_view datagram, Priority priority) override;
  void on_state(const ReceivedState& state, const Datagram& datagram) override;
  void on_identity(const Identity& identity) override;
  void on_result(Ticket ticket, const CommandResult& result) override;

  Time now_{1'000'000};
  asio::io_context io_;
  Random random_{1};
  Cable* cable_ = nullptr;
  sim::SimulatedBoard board_;
  test::DrivenSession session_;
  std::deque<std::string> to_board_;
  std::deque<std::string> to_host_;
  std::deque<ReceivedState> states_;
  BoardIdentity identity_;
  std::optional<std::pair<Ticket, CommandResult>> ended_;
  const bool papers_firmware_;
  bool supervised_ = false;
  bool silent_ = false;
};

}  // namespace r4::simulation
