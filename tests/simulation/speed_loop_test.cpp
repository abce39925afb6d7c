// SPDX-License-Identifier: GPL-3.0-or-later
// A host controls a wheel's speed at 100 Hz over a link with delay and loss, in virtual time.
// Checks the values that docs/how-to/control.md promises.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include "r4link/control/loop.hpp"
#include "r4link/control/pid.hpp"
#include "r4link/control/sensors.hpp"
#include "virtual_robot.hpp"

namespace r4::simulation {
namespace {

using control::LoopEnd;

constexpr VirtualRobot::Link slow_link{.delay_us = 5000, .jitter_us = 2000, .loss = 0};
constexpr VirtualRobot::Link lossy_link{.delay_us = 5000, .jitter_us = 2000, .loss = 0.2};
constexpr double top_m_s = 2.0;  // top speed of the wheel, at 4000 counts a second

control::LoopOptions speed_loop_options() {
  control::LoopOptions options;
  options.fields = "ENC1,ENC1HZ";
  options.standstill = {{.encoder = 1, .channel = 1}};
  return options;
}

// The loop of docs/how-to/control.md, with a session in place of a board.
class SpeedLoop {
 public:
  enum class By { counts, frequency };

  SpeedLoop(std::uint64_t seed, const VirtualRobot::Link& link, By by = By::counts)
      : robot(seed, link, "ENC1,ENC1HZ"), guard(speed_loop_options()), by_(by) {
    if (by == By::frequency) pid = control::Pid({.kp = 0.1, .ki = 0.2, .feed_forward = 0.45});
    robot.state_came = [this](const ReceivedState& state) { on_state(state); };
  }

  void run(std::uint64_t ms) {
    while (ms-- != 0 && guard.ended() == LoopEnd::none) {
      robot.pass_millisecond();
      if (!began) continue;
      guard.check(robot.session().link().state, robot.session().disarmed_by(), robot.clock());
      const double rate = (robot.model().shaft_count(1) - counts_) * 1.0;
      counts_ = robot.model().shaft_count(1);
      smooth_ += (rate - smooth_) / 20;  // counts a millisecond of the real shaft
      speeds.push_back(smooth_ * 1000 * wheel.metres_a_count());
    }
  }
  void begin(double m_s) {
    wanted = m_s;
    counts_ = robot.model().shaft_count(1);
    guard.start(robot.clock());
    began = true;
  }
  // Seconds until the speed stays within 5 % of the commanded speed.
  double settled_s() const {
    std::size_t last = 0;
    for (std::size_t i = 0; i < speeds.size(); ++i) {
      if (std::abs(speeds[i] - wanted) > 0.05 * wanted) last = i + 1;
    }
    return static_cast<double>(last) / 1000;
  }
  double overshoot() const { return *std::max_element(speeds.begin(), speeds.end()) / wanted - 1; }

  VirtualRobot robot;
  control::LoopGuard guard;
  control::Wheel wheel{{.encoder = 1, .counts_a_turn = 4000, .radius_m = top_m_s / 2 / M_PI}, 30};
  control::Pid pid{{.kp = 0.8, .ki = 3.2, .feed_forward = 0.2}};
  double wanted = 0;
  bool began = false;
  std::vector<double> speeds;  // one for each millisecond

 private:
  void on_state(const ReceivedState& state) {
    if (!began) return;
    const auto dt_s = guard.on_state(state, robot.session().disarmed_by(), robot.clock());
    if (!dt_s) return;
    wheel.advance(state);
    const double is = by_ == By::counts ? wheel.speed_m_s() : wheel.measured_m_s(state);
    const double duty = pid.step(wanted, is, *dt_s);
    const auto setpoint = Setpoints{Command::osmc(1, Duty(duty))};
    guard.on_commanded(setpoint);
    robot.session().post(setpoint[0], robot.now());
  }

  By by_;
  std::int32_t counts_ = 0;
  double smooth_ = 0;
};

TEST(SpeedLoop, SettlesWithinHalfASecondOverADelayedLink) {
  double slowest_s = 0, highest = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    SpeedLoop loop(seed, slow_link);
    ASSERT_TRUE(loop.robot.arm());
    loop.begin(1.0);
    loop.run(1500);
    ASSERT_EQ(loop.guard.ended(), LoopEnd::none) << loop.guard.why();
    slowest_s = std::max(slowest_s, loop.settled_s());
    highest = std::max(highest, loop.overshoot());
  }
  fmt::print("settled within {:.3f} s, overshoot {:.1f} %\n", slowest_s, highest * 100);
  EXPECT_LE(slowest_s, 0.5);
  EXPECT_LE(highest, 0.05);
}

TEST(SpeedLoop, StaysStableWhenAFifthOfTheDatagramsIsLost) {
  double farthest = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SpeedLoop loop(seed, lossy_link);
    ASSERT_TRUE(loop.robot.arm());
    loop.begin(1.0);
    loop.run(3000);
    ASSERT_EQ(loop.guard.ended(), LoopEnd::none) << seed << ": " << loop.guard.why();
    for (std::size_t i = 1000; i < loop.speeds.size(); ++i) {
      farthest = std::max(farthest, std::abs(loop.speeds[i] - loop.wanted));
    }
  }
  fmt::print("after a second within {:.1f} %\n", farthest * 100);
  EXPECT_LE(farthest, 0.1);
}

TEST(SpeedLoop, SettlesWithin800MillisecondsOnTheMeasuredFrequency) {
  SpeedLoop loop(1, slow_link, SpeedLoop::By::frequency);
  ASSERT_TRUE(loop.robot.arm());
  loop.begin(1.0);
  loop.run(3000);
  fmt::print("settled within {:.3f} s, overshoot {:.1f} %\n", loop.settled_s(),
             loop.overshoot() * 100);
  EXPECT_LE(loop.settled_s(), 0.8);
  EXPECT_LE(loop.overshoot(), 0.05);
}

TEST(SpeedLoop, EndsWhenTheHandleIsReleasedOrTheEncoderStops) {
  SpeedLoop let_go(1, slow_link);
  ASSERT_TRUE(let_go.robot.arm());
  let_go.begin(1.0);
  let_go.run(500);
  let_go.robot.model().hold_handle(false);
  let_go.run(1000);
  EXPECT_NE(let_go.guard.ended(), LoopEnd::none);
  EXPECT_NE(let_go.guard.ended(), LoopEnd::late);
  EXPECT_TRUE(let_go.robot.model().pins().is_safe());

  SpeedLoop stalled(1, slow_link);
  ASSERT_TRUE(stalled.robot.arm());
  stalled.begin(1.0);
  stalled.run(500);
  stalled.robot.model().stall_motor(1, true);
  const double since = stalled.robot.seconds();
  stalled.run(3000);
  EXPECT_EQ(stalled.guard.ended(), LoopEnd::standstill);
  EXPECT_LE(stalled.robot.seconds() - since, 0.55);
  EXPECT_NE(stalled.guard.why().find("ENC1 stands still, although OSMC 1 has been driven with"),
            std::string::npos);
}

TEST(SpeedLoop, IsTheSameForTheSameSeed) {
  const auto speeds_of = [](std::uint64_t seed) {
    SpeedLoop loop(seed, lossy_link);
    EXPECT_TRUE(loop.robot.arm());
    loop.begin(1.0);
    loop.run(500);
    return loop.speeds;
  };
  EXPECT_EQ(speeds_of(3), speeds_of(3));
  EXPECT_NE(speeds_of(3), speeds_of(4));
}

}  // namespace
}  // namespace r4::simulation
