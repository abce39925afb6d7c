// SPDX-License-Identifier: GPL-3.0-or-later
// Groups of commands from end to end: r4::Board with simulated boards, and the times at which the
// registers of the chips change.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>

#include "firmware/ports/sim/simulated_board.hpp"
#include "r4link/board.hpp"
#include "r4link/error.hpp"
#include "tests/support/at_will.hpp"
#include "tests/support/board_in_a_thread.hpp"
#include "tests/support/driven_board.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

constexpr Direction forward = Direction::forward;

// The time on the I2C bus at which each wheel begins to turn as `wanted`. The outputs of a chip
// change at the end of a transfer.
class Wheels final : public sim::I2cObserver {
 public:
  // `osmc`: the number of OSMC channels among the four wheels. The other wheels are DHB12 channels.
  Wheels(sim::BoardChips& chips, Drive wanted, int osmc)
      : chips_(chips), wanted_(wanted), osmc_(osmc) {
    chips_.bus.set_observer(this);
  }
  ~Wheels() { chips_.bus.set_observer(nullptr); }
  Wheels(const Wheels&) = delete;
  Wheels& operator=(const Wheels&) = delete;

  bool all() const {
    return std::all_of(std::begin(changed_ns_), std::end(changed_ns_), [](auto& c) { return !!c; });
  }
  double skew_ms() const {
    const auto [first, last] = std::minmax_element(std::begin(changed_ns_), std::end(changed_ns_));
    return static_cast<double>(**last - **first) / 1e6;
  }

 private:
  void on_transfer(const sim::I2cTransfer& transfer) override {
    for (int i = 0; i < 4; ++i) {
      const Drive drive = i < osmc_ ? chips_.osmc_drive(i + 1) : chips_.dhb12_drive(i + 1 - osmc_);
      if (drive == wanted_ && !changed_ns_[i]) {
        changed_ns_[i] = transfer.start_ns + transfer.duration_ns;
      }
    }
  }

  sim::BoardChips& chips_;
  Drive wanted_;
  int osmc_;
  std::optional<std::uint64_t> changed_ns_[4];
};

// The time between the first and the last of four wheels that one apply() sets.
double skew_of(const std::string& transport, int osmc, Drive before, Drive wanted) {
  BoardInAThread simulated(transport);
  Board board(simulated.url(), at_will());
  board.wait_active();
  const auto all = [&](Drive drive) {
    Setpoints wheels;
    for (int i = 1; i <= osmc; ++i) wheels.add(Command::osmc(i, Pwm(drive.pwm), drive.direction));
    for (int i = 1; i <= 4 - osmc; ++i)
      wheels.add(Command::dhb12(i, Pwm(drive.pwm), drive.direction));
    return wheels;
  };
  board.send(all(before));
  std::optional<Wheels> wheels;
  simulated.run([&](sim::SimulatedBoard& b) { wheels.emplace(b.model().chips(), wanted, osmc); });
  board.send(all(wanted));
  double skew_ms = -1;
  simulated.run([&](sim::SimulatedBoard&) {
    EXPECT_TRUE(wheels->all());
    if (wheels->all()) skew_ms = wheels->skew_ms();
    wheels.reset();
  });
  return skew_ms;
}

TEST(BoardGroup, FourMotorsChangeWithinAMillisecond) {
  const Drive off;
  const Drive ahead{358, forward};
  const Drive back{4000, Direction::reverse};
  for (const char* transport : {"udp", "pty"}) {
    for (const auto& [before, wanted] : {std::pair(off, ahead), std::pair(ahead, back)}) {
      EXPECT_EQ(skew_of(transport, 4, before, wanted), 0) << transport;
      EXPECT_EQ(skew_of(transport, 0, before, wanted), 0) << transport;
      const double skew_ms = skew_of(transport, 2, before, wanted);
      RecordProperty("skew_us", static_cast<int>(skew_ms * 1000));
      EXPECT_GT(skew_ms, 0) << transport;
      EXPECT_LE(skew_ms, 1) << transport;
    }
  }
}

struct DrivenGroup : DrivenBoard {};

TEST_F(DrivenGroup, IsConfirmedOrRefusedAsAWhole) {
  board.fields("DEFAULT,OSMC2,SERVO3POS,DAC2");
  board.send(Setpoints{Command::osmc(1, Pwm(358), forward), Command::osmc(2, Pwm(359), forward),
                       Command::servo(3, Microseconds(1500)), Command::dac(2, Millivolts(1650))});
  const State state = board.next_state();
  EXPECT_EQ(state.osmc(1), (Drive{358, forward}));
  EXPECT_EQ(state.osmc(2), (Drive{359, forward}));
  EXPECT_EQ(state.servo_us(3), 1500);
  EXPECT_EQ(state.dac_mv(2), 1650);
  board.send("O:1,1,1;O:2,1,2");
  EXPECT_EQ(board.next_state().osmc(2).pwm, 2);
  board.stop();
  const Problem refused = problem_of([&] { board.send("O:5,1,1;O:6,1,2"); });
  EXPECT_EQ(refused.outcome, Outcome::refused);
  EXPECT_EQ(refused.refusal, Refusal::safe);
  EXPECT_EQ(refused.thing, "O:5,1,1;O:6,1,2");
  EXPECT_TRUE(contains(refused.reason, "none of the 2 commands was executed"));
  EXPECT_EQ(problem_of([&] { board.send(Setpoints{}); }).kind, ErrorKind::usage);
  EXPECT_EQ(problem_of([&] { board.send("O:5,1,1;E:CLEAR"); }).kind, ErrorKind::usage);
}

}  // namespace
}  // namespace r4::test
