// SPDX-License-Identifier: GPL-3.0-or-later
// docs/examples/openpodcar with joystick, cmd_vel and goals, in virtual time: which input drives,
// and how far the car rolls after the input ends.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "docs/examples/openpodcar/model.hpp"
#include "docs/examples/openpodcar/pilot.hpp"
#include "docs/examples/openpodcar/podcar.hpp"
#include "virtual_robot.hpp"

namespace r4::simulation {
namespace {

using control::LoopEnd;
using control::Twist;
using Mode = Pilot::Mode;

constexpr VirtualRobot::Link pilot_link{.delay_us = 5000, .jitter_us = 2000, .loss = 0.01};
constexpr int joy_period_ms = 50;       // joy_node repeats its message with this period
constexpr int cmd_vel_period_ms = 100;  // the period of teleop_twist_keyboard and similar nodes
constexpr double nan_number = std::numeric_limits<double>::quiet_NaN();

// The program in main_ros2.cpp, with a session in place of a board, and the publishers.
class PilotRun {
 public:
  explicit PilotRun(std::uint64_t seed = 1)
      : robot(seed, pilot_link, podcar_fields, &model), guard_(podcar_loop()) {
    robot.state_came = [this](const ReceivedState& state) { on_state(state); };
    while (!robot.session().in_control(robot.now())) robot.pass_millisecond();
    EXPECT_NE(robot.session().send(Command::setting("recovery", "rearm"), patience, robot.now()),
              0U);
    pass(200);
  }

  void pass(int ms) {
    for (; ms > 0; --ms) pass_millisecond();
  }
  // Presses and releases Start. If the board does not refuse, the board is then armed.
  void press_start() {
    start = true;
    pass(200);
    start = false;
    pass(300);
  }
  // The distance that the car rolls until it stops. The car must stop within `seconds` and stay
  // stopped for two seconds.
  double rolls_m(int seconds = 10) {
    const double from_m = model.travelled_m();
    int standing_ms = 0;
    for (int ms = 0; ms < (seconds + 2) * 1000 && standing_ms < 2000; ++ms) {
      pass(1);
      standing_ms = model.place().speed_m_s == 0 ? standing_ms + 1 : 0;
    }
    EXPECT_EQ(standing_ms, 2000);
    return model.travelled_m() - from_m;
  }
  bool moves_within(int ms) {
    const double from_m = model.travelled_m();
    pass(ms);
    return model.travelled_m() > from_m + 0.01;
  }
  std::string to_goal(double x_m, double y_m) {
    return pilot.on_goal({x_m, y_m}, podcar.pose(), robot.clock());
  }
  bool driving() const { return phase_ == Phase::driving; }

  // The messages that are published periodically. Without `joystick`, the joystick's messages end.
  bool joystick = true;
  bool hold = false, start = false, stop = false;
  float speed_axis = 0, steering_axis = 0;
  std::optional<Twist> cmd_vel;

  PodcarModel model;
  Podcar podcar;
  Pilot pilot;
  VirtualRobot robot;

 private:
  enum class Phase { waiting, arming, guarding, driving };
  static constexpr std::chrono::seconds patience{1};

  void publish() {
    if (joystick && ms_ % joy_period_ms == 0) {
      const JoyMap map;
      std::array<float, 6> axes{};
      std::array<std::int32_t, 8> buttons{};
      axes[map.speed_axis] = speed_axis;
      axes[map.steering_axis] = steering_axis;
      buttons[map.hold] = hold;
      buttons[map.start] = start;
      buttons[map.stop] = stop;
      pilot.on_joy(axes, buttons, robot.clock());
    }
    if (cmd_vel && ms_ % cmd_vel_period_ms == 0) pilot.on_cmd_vel(*cmd_vel, robot.clock());
  }
  void pass_millisecond() {
    ++ms_;
    publish();
    robot.pass_millisecond();
    Session& session = robot.session();
    switch (phase_) {
      case Phase::waiting:
        if (pilot.mode() == Mode::off) return;
        session.arm(patience, robot.now());
        phase_ = Phase::arming;
        phase_ms_ = ms_;
        return;
      case Phase::arming:
        if (session.disarmed_by() == DisarmCause::none) {
          session.send(Command::proximity(1, Centimetres(podcar_clearance_cm)), patience,
                       robot.now());
          phase_ = Phase::guarding;
          phase_ms_ = ms_;
        } else if (ms_ - phase_ms_ > 1000) {
          end("refused");
        }
        return;
      case Phase::guarding:
        if (ms_ - phase_ms_ < 200) return;
        podcar.begin_drive();
        pilot.begin(robot.clock());
        guard_.start(robot.clock());
        phase_ = Phase::driving;
        return;
      case Phase::driving:
        guard_.check(session.link().state, session.disarmed_by(), robot.clock());
        if (guard_.ended() != LoopEnd::none) end(guard_.why());
        return;
    }
  }
  void end(const std::string& why) {
    robot.session().send(Command::stop(), patience, robot.now());
    pilot.end(why);
    phase_ = Phase::waiting;
  }
  void on_state(const ReceivedState& state) {
    if (phase_ != Phase::driving) {
      podcar.sense(state);
      return;
    }
    const auto dt_s = guard_.on_state(state, robot.session().disarmed_by(), robot.clock());
    if (!dt_s) return;
    if (!podcar.sense(state)) pilot.end("the steering sensor");
    if (!podcar.obeys()) pilot.end("it does not obey");
    const auto wish = pilot.wish(podcar.pose(), robot.clock());
    if (!wish) return guard_.end(LoopEnd::asked, pilot.why());
    const Setpoints out = podcar.drive(*wish, *dt_s);
    guard_.on_commanded(out);
    robot.session().post(out, robot.now());
  }

  control::LoopGuard guard_;
  Phase phase_ = Phase::waiting;
  int phase_ms_ = 0;  // when the phase began
  int ms_ = 0;
};

// Drives at 1.2 m/s with the joystick. Returns the speed.
double hold_and_drive(PilotRun& run) {
  run.press_start();
  run.hold = true;
  run.speed_axis = 1;
  run.pass(4000);
  EXPECT_NEAR(run.model.place().speed_m_s, podcar_geometry.max_speed_m_s, 0.05);
  EXPECT_EQ(run.pilot.mode(), Mode::manual);
  return run.model.place().speed_m_s * 1.02;
}

TEST(OpenPodcarPilot, DrivesToSeveralGoals) {
  PilotRun run;
  run.press_start();
  const std::vector<Waypoint> goals = {{8, 0}, {10, 6}, {4, 6}, {0, 0}, {-4, 4}, {-3, 3}};
  for (const Waypoint& goal : goals) {
    EXPECT_EQ(run.to_goal(goal.x_m, goal.y_m), "");
    run.pass(1000);
    const double rolled_m = run.rolls_m(60);
    const PodcarPlace& place = run.model.place();
    const double off_m = std::hypot(place.x_m - goal.x_m, place.y_m - goal.y_m);
    fmt::print("goal {}, {}: {:.1f} m, {:.3f} m from it\n", goal.x_m, goal.y_m, rolled_m, off_m);
    EXPECT_LE(off_m, 0.3);
    EXPECT_TRUE(run.driving()) << run.pilot.why();
  }
}

TEST(OpenPodcarPilot, FindsACourseToGoalsInEveryDirection) {
  for (int direction = 0; direction < 24; ++direction) {
    for (const double distance_m : {0.5, 2.0, 4.0, 8.0}) {
      const double angle = direction * std::numbers::pi / 12;
      const Waypoint goal{1 + distance_m * std::cos(angle), 2 + distance_m * std::sin(angle)};
      control::Pose pose{1, 2, 0.7};
      Course course = Course::towards(goal, pose);
      const control::Ackermann car(podcar_geometry);
      for (int step = 0; step < 6000 && !course.finished(); ++step) {
        const Twist twist = car.twist(car.command(course.wish(pose, 1)));
        pose.yaw_rad += twist.turn_rad_s * 0.01;
        pose.x_m += twist.forward_m_s * 0.01 * std::cos(pose.yaw_rad);
        pose.y_m += twist.forward_m_s * 0.01 * std::sin(pose.yaw_rad);
      }
      EXPECT_TRUE(course.finished()) << goal.x_m << ", " << goal.y_m;
      EXPECT_LE(std::hypot(pose.x_m - goal.x_m, pose.y_m - goal.y_m), 0.3)
          << goal.x_m << ", " << goal.y_m;
      EXPECT_LE(course.length_m(), distance_m + 2 * std::numbers::pi * 2.5);
    }
  }
}

TEST(OpenPodcarPilot, DrivesACircleByCmdVelAndStopsWhenItIsOld) {
  PilotRun run;
  run.cmd_vel = Twist{0.8, 0.32};  // a radius of 2.5 m
  EXPECT_FALSE(run.moves_within(1000));
  run.press_start();
  run.pass(3000);
  double least_x = 1e9, most_x = -1e9;
  for (int ms = 0; ms < 20'000; ++ms) {
    run.pass(1);
    least_x = std::min(least_x, run.model.place().x_m);
    most_x = std::max(most_x, run.model.place().x_m);
  }
  fmt::print("a circle of {:.2f} m\n", most_x - least_x);
  EXPECT_NEAR(most_x - least_x, 5, 0.25);
  run.cmd_vel.reset();
  const double rolled_m = run.rolls_m();
  fmt::print("cmd_vel silent: {:.3f} m\n", rolled_m);
  EXPECT_LE(rolled_m, PodcarModel::coasting_distance_m(0.82) + 0.82 * 0.53);
  EXPECT_TRUE(run.driving());
}

TEST(OpenPodcarPilot, LimitsCommandsToWhatTheVehicleCanDo) {
  PilotRun run;
  run.press_start();
  for (const Twist& asked : {Twist{50, 0}, Twist{1, 90}, Twist{-5, 1}, Twist{0, 1}}) {
    run.pilot.on_cmd_vel(asked, run.robot.clock());
    const auto wish = run.pilot.wish({}, run.robot.clock());
    ASSERT_TRUE(wish);
    EXPECT_LE(wish->forward_m_s, podcar_geometry.max_speed_m_s);
    EXPECT_GE(wish->forward_m_s, -Pilot::backwards_m_s);
    EXPECT_LE(std::abs(wish->turn_rad_s), std::abs(wish->forward_m_s) *
                                                  std::tan(podcar_geometry.max_steering_rad) /
                                                  podcar_geometry.wheelbase_m +
                                              1e-9);
  }
}

TEST(OpenPodcarPilot, TheJoystickHasPrecedenceAndADroppedGoalStaysDropped) {
  PilotRun run;
  run.press_start();
  EXPECT_EQ(run.to_goal(50, 0), "");
  run.pass(3000);
  run.cmd_vel = Twist{0.4, 0.1};
  run.pass(3000);
  EXPECT_NEAR(run.podcar.speed_m_s(), 0.4, 0.05);  // not 0.8, the speed of the goal
  EXPECT_EQ(run.to_goal(50, 0), "cmd_vel drives");
  run.hold = true;
  run.speed_axis = -0.25F;
  run.pass(3000);
  EXPECT_NEAR(run.podcar.speed_m_s(), -0.3, 0.05);
  EXPECT_FALSE(run.to_goal(50, 0).empty());
  run.hold = false;
  run.rolls_m();  // although cmd_vel is published
  EXPECT_FALSE(run.moves_within(2000));
  run.press_start();
  EXPECT_TRUE(run.moves_within(2000));
  run.cmd_vel.reset();
  run.rolls_m();  // the goal has ended
  EXPECT_FALSE(run.moves_within(2000));
}

// An event that ends the drive, and how to recover from it.
struct PilotMishap {
  const char* name;
  void (*set)(PilotRun&, bool happens);
  double most_m;  // the longest distance that the car may roll, from 1.22 m/s
};

TEST(OpenPodcarPilot, WaitsForStartAfterAnyEndOfADrive) {
  const double braking_m = PodcarModel::braking_distance_m(1.22);
  const PilotMishap mishaps[] = {
      {"handle let go", [](PilotRun& run, bool is) { run.robot.model().hold_handle(!is); },
       braking_m + 1.22 * 0.02},
      {"link lost", [](PilotRun& run, bool is) { run.robot.link_cut = is; },
       braking_m + 1.22 * 1.02},
      {"states lost", [](PilotRun& run, bool is) { run.robot.states_stop = is; },
       braking_m + 1.22 * 0.2},
      {"obstacle",
       [](PilotRun& run, bool is) {
         run.model.set_wall(is ? run.model.place().x_m + PodcarModel::nose_m + 1.4 : 1e9);
       },
       braking_m + 1.22 * 0.5},
  };
  for (const PilotMishap& mishap : mishaps) {
    PilotRun run;
    hold_and_drive(run);
    run.cmd_vel = Twist{0.5, 0};
    mishap.set(run, true);
    const double rolled_m = run.rolls_m();
    fmt::print("{} at 1.2 m/s: {:.3f} m: {}\n", mishap.name, rolled_m, run.pilot.why());
    EXPECT_LE(rolled_m, mishap.most_m) << mishap.name;
    EXPECT_TRUE(run.robot.model().pins().is_safe()) << mishap.name;
    run.hold = false;
    run.press_start();  // refused, or the drive ends again
    EXPECT_FALSE(run.moves_within(2000)) << mishap.name;
    mishap.set(run, false);
    EXPECT_FALSE(run.moves_within(3000)) << mishap.name;
    run.press_start();
    EXPECT_TRUE(run.moves_within(2000)) << mishap.name << run.pilot.why();
  }
}

TEST(OpenPodcarPilot, StopsWhenTheJoystickDisconnectsWithItsButtonHeld) {
  PilotRun run;
  const double speed = hold_and_drive(run);
  run.joystick = false;
  const double rolled_m = run.rolls_m();
  const double allowed_m = PodcarModel::braking_distance_m(speed) + speed * 0.34;
  fmt::print("joystick silent at 1.2 m/s: {:.3f} m, of {:.3f} m\n", rolled_m, allowed_m);
  EXPECT_LE(rolled_m, allowed_m);
  EXPECT_EQ(run.pilot.why(), "the joystick is silent");
  EXPECT_TRUE(run.robot.model().pins().is_safe());
  run.joystick = true;  // its button is pressed
  EXPECT_FALSE(run.moves_within(3000));
}

TEST(OpenPodcarPilot, TheStopButtonStopsTheVehicle) {
  for (const bool manual : {true, false}) {
    PilotRun run;
    double speed = hold_and_drive(run);
    if (!manual) {
      run.hold = false;
      run.cmd_vel = Twist{1, 0};
      run.press_start();
      run.pass(3000);
      speed = run.model.place().speed_m_s * 1.02;
      EXPECT_GT(speed, 0.9);
    }
    run.stop = true;
    const double rolled_m = run.rolls_m();
    fmt::print("stop at {:.2f} m/s: {:.3f} m\n", speed / 1.02, rolled_m);
    EXPECT_LE(rolled_m, PodcarModel::braking_distance_m(speed) + speed * 0.09);
    EXPECT_EQ(run.pilot.why(), "the stop button");
    run.stop = false;
    EXPECT_FALSE(run.moves_within(3000));
  }
}

TEST(OpenPodcarPilot, HoldingStartDownArmsOnlyOnce) {
  PilotRun run;
  run.joystick = false;
  run.pass(1000);
  run.start = run.joystick = true;  // pressed when the first message arrives
  run.pass(1000);
  EXPECT_EQ(run.pilot.mode(), Mode::off);
  run.start = false;
  run.pass(100);
  run.start = true;
  run.cmd_vel = Twist{0.5, 0};
  EXPECT_TRUE(run.moves_within(3000));
  run.robot.model().hold_handle(false);
  run.rolls_m();
  run.robot.model().hold_handle(true);
  EXPECT_FALSE(run.moves_within(3000));
  EXPECT_FALSE(run.driving());
  run.press_start();  // Start is already pressed
  run.press_start();
  EXPECT_TRUE(run.moves_within(2000));
}

TEST(OpenPodcarPilot, DoesNotDriveWithTwoJoysticks) {
  PilotRun run;
  run.press_start();
  ASSERT_TRUE(run.driving());
  const std::array<float, 6> axes{};
  const std::array<std::int32_t, 8> buttons{};
  run.pilot.on_joy(axes, buttons, run.robot.clock(), 7);
  run.pass(100);
  EXPECT_FALSE(run.driving());
  EXPECT_EQ(run.pilot.why(), "there are two joysticks");
  run.start = true;  // pressed on only one of the two joysticks
  for (int ms = 0; ms < 1000; ms += 10) {
    run.pilot.on_joy(axes, buttons, run.robot.clock(), 7);
    run.pass(10);
    ASSERT_EQ(run.pilot.mode(), Mode::off);
  }
  run.start = false;
  run.pass(400);
  run.press_start();
  EXPECT_TRUE(run.driving()) << "the other joystick has stopped publishing";
}

TEST(OpenPodcarPilot, ANewDriveStartsWithAResetController) {
  Podcar podcar;
  podcar.begin_drive();
  for (int i = 0; i < 200; ++i) podcar.drive({1, 0}, 0.01);  // the encoder is disconnected
  ASSERT_EQ(podcar.drive({1, 0}, 0.01)[0].value, pwm_max);
  podcar.begin_drive();
  EXPECT_EQ(podcar.drive({0.1, 0}, 0)[0].value, 0);
  EXPECT_LE(podcar.drive({0.1, 0}, 0.01)[0].value, static_cast<int>(2 * 0.01 * pwm_max) + 1);
}

TEST(OpenPodcarPilot, EndsWhenTheSteeringDoesNotFollow) {
  Podcar podcar;
  podcar.begin_drive();
  for (int ms = 0; ms < 490; ms += 10) podcar.drive({1, 0.4}, 0.01);
  EXPECT_TRUE(podcar.obeys());
  for (int ms = 0; ms < 30; ms += 10) podcar.drive({1, 0.4}, 0.01);
  EXPECT_FALSE(podcar.obeys());
  podcar.begin_drive();
  EXPECT_TRUE(podcar.obeys());
  for (int ms = 0; ms < 5000; ms += 10) podcar.drive({0, 0}, 0.01);
  EXPECT_TRUE(podcar.obeys()) << "the car does not steer while it stands";
}

TEST(OpenPodcarPilot, KeepsOnlyAStopReceivedWhileArming) {
  using namespace std::chrono_literals;
  for (const bool stopped : {false, true}) {
    const JoyMap map;
    constexpr std::size_t no_button = 99;
    Pilot pilot;
    const auto press = [&](std::size_t button, Pilot::Time now) {
      std::array<float, 6> axes{};
      std::array<std::int32_t, 8> buttons{};
      axes[map.speed_axis] = 1;
      if (button < buttons.size()) buttons[button] = 1;
      pilot.on_joy(axes, buttons, now);
    };
    Pilot::Time now{1000ms};
    press(no_button, now);
    press(map.start, now += 50ms);
    EXPECT_EQ(pilot.mode(), Mode::automatic);
    if (stopped) press(map.stop, now += 50ms);
    press(map.hold, now += 50ms);
    pilot.begin(now += 1000ms);
    EXPECT_EQ(pilot.wish({}, now), stopped ? std::nullopt : std::optional(Twist{}));
    press(map.hold, now += 50ms);
    const auto held = pilot.wish({}, now);
    EXPECT_EQ(held ? held->forward_m_s : 0, stopped ? 0 : podcar_geometry.max_speed_m_s);
    EXPECT_EQ(pilot.wish({}, now + 301ms), std::nullopt);
  }
}

TEST(OpenPodcarPilot, RefusesInputsThatAreNotNumbers) {
  PilotRun run;
  run.press_start();
  run.cmd_vel = Twist{nan_number, 0};
  EXPECT_FALSE(run.moves_within(1000));
  run.cmd_vel = Twist{0.5, std::numeric_limits<double>::infinity()};
  EXPECT_FALSE(run.moves_within(1000));
  for (const double wrong : {nan_number, 1e300, -std::numeric_limits<double>::infinity()}) {
    EXPECT_EQ(run.to_goal(wrong, 0), "it is too far away, or not a position");
  }
  run.hold = true;
  run.speed_axis = std::numeric_limits<float>::quiet_NaN();
  EXPECT_FALSE(run.moves_within(1000));
  EXPECT_EQ(run.pilot.why(), "the joystick is silent");
  run.speed_axis = 0;
  run.hold = false;
  run.pass(100);
  run.press_start();
  EXPECT_TRUE(run.driving());
  run.speed_axis = 7;
  run.stop = true;  // the stop is obeyed although the axis is invalid
  run.pass(100);
  EXPECT_EQ(run.pilot.why(), "the stop button");
}

}  // namespace
}  // namespace r4::simulation
