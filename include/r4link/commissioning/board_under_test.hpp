// SPDX-License-Identifier: GPL-3.0-or-later
// The interface of a board for a commissioning. BoardOnLink uses an r4::Board; tests use a
// simulated board in virtual time. Calls that wait throw Error.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "../board.hpp"
#include "../command.hpp"
#include "../config.hpp"
#include "../link.hpp"
#include "../wiring/wiring.hpp"

namespace r4::commissioning {

class R4LINK_API BoardUnderTest {
 public:
  using Duration = std::chrono::milliseconds;

  virtual void wait_heard() = 0;  // until the link is active or safe
  // The next state in order, of at least the last ten seconds. Empty if no state arrives in time.
  virtual std::optional<ReceivedState> next_state(Duration timeout) = 0;
  virtual void forget_states() = 0;  // drops the states that have arrived
  virtual LinkStatus link() = 0;

  virtual BoardIdentity identify() = 0;
  virtual BoardWiring wiring() = 0;
  virtual void give_wiring(const Wiring& wiring) = 0;
  virtual std::vector<std::uint8_t> scan() = 0;  // the addresses that answer on the user's I2C bus

  // Throws if the board does not confirm the command within `timeout`.
  virtual void send(const Command& command, Duration timeout) = 0;
  virtual void arm() = 0;  // closes relay 1
  virtual void stop() = 0;
  // While supervised, the board goes safe if next_state() is not called for 0.5 s.
  virtual void supervise(bool supervised) = 0;
  // While silent, only stops are sent, and no heartbeats.
  virtual void be_silent(bool silent) = 0;

  // The transports that lead to the board. Functions without an argument `transport` use the
  // first transport.
  virtual std::vector<std::string> transports() = 0;
  struct Quality {
    double states_a_second = 0;
    double loss = 0;           // 0-1
    double round_trip_ms = 0;  // 0: unknown
  };
  virtual Quality measure(std::size_t transport, Duration time) = 0;
  virtual void stop_over(std::size_t transport) = 0;

 protected:
  ~BoardUnderTest() = default;
};

// `board`: in control, not used elsewhere meanwhile. `others`: further URLs of the same board.
class R4LINK_API BoardOnLink final : public BoardUnderTest {
 public:
  explicit BoardOnLink(Board& board, std::vector<std::string> others = {});

  void wait_heard() override;
  std::optional<ReceivedState> next_state(Duration timeout) override;
  void forget_states() override;
  LinkStatus link() override;
  BoardIdentity identify() override;
  BoardWiring wiring() override;
  void give_wiring(const Wiring& wiring) override;
  std::vector<std::uint8_t> scan() override;
  void send(const Command& command, Duration timeout) override;
  void arm() override;
  void stop() override;
  void supervise(bool supervised) override;
  void be_silent(bool silent) override;
  std::vector<std::string> transports() override;
  Quality measure(std::size_t transport, Duration time) override;
  void stop_over(std::size_t transport) override;

 private:
  R4LINK_PRIVATE void set_watchdog();

  Board& board_;
  std::vector<std::string> others_;
  States states_;
  bool supervised_ = false;
  bool silent_ = false;
  std::chrono::steady_clock::time_point fed_{};
};

}  // namespace r4::commissioning
