// SPDX-License-Identifier: GPL-3.0-or-later
// docs/examples/openpodcar in virtual time: its control and its model, joined by the firmware, the
// session and a link with a delay. Measures how well the car keeps its course, and how far it rolls
// after an incident at speed.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "docs/examples/openpodcar/course.hpp"
#include "docs/examples/openpodcar/drive.hpp"
#include "docs/examples/openpodcar/model.hpp"
#include "docs/examples/openpodcar/podcar.hpp"
#include "r4link/error.hpp"
#include "virtual_robot.hpp"

namespace r4::simulation {
namespace {

using control::LoopEnd;

constexpr VirtualRobot::Link podcar_link{.delay_us = 5000, .jitter_us = 2000, .loss = 0.01};
constexpr double board_timeout_s = 1.0;

// The program in main.cpp, with a session in place of a board. Each step of PodcarRun is a step of
// the program.
class PodcarRun {
 public:
  explicit PodcarRun(Course given, std::uint64_t seed = 1)
      : course(std::move(given)),
        robot(seed, podcar_link, podcar_fields, &model),
        guard(podcar_loop()) {
    robot.state_came = [this](const ReceivedState& state) { on_state(state); };
    EXPECT_TRUE(robot.arm());
    send(Command::setting("recovery", "rearm"));
    send(Command::proximity(1, Centimetres(podcar_clearance_cm)));
    robot.pass(200);
    PodcarPlace start;
    start.yaw_rad = course.heading_rad();
    model.put(start);
    podcar.begin_at({0, 0, start.yaw_rad});
    guard.start(robot.clock());
    begun_ = true;
  }

  // Advances the time by a millisecond. False after the loop has ended.
  bool pass() {
    robot.pass_millisecond();
    if (!robot.host_lives) return false;
    guard.check(robot.session().link().state, robot.session().disarmed_by(), robot.clock());
    if (guard.ended() != LoopEnd::none && !rests_) {
      rests_ = true;
      robot.session().post(podcar_loop().rest, robot.now());
    }
    return guard.ended() == LoopEnd::none;
  }
  double deviation() const {
    return std::abs(course.deviation_m(model.place().x_m, model.place().y_m));
  }
  // The distance that the car rolls until it stops. The car must stop within ten seconds and stay
  // stopped for two seconds.
  double rolls_m() {
    const double from_m = model.travelled_m();
    int standing_ms = 0;
    for (int ms = 0; ms < 12'000 && standing_ms < 2000; ++ms) {
      pass();
      standing_ms = model.place().speed_m_s == 0 ? standing_ms + 1 : 0;
    }
    EXPECT_EQ(standing_ms, 2000);
    return model.travelled_m() - from_m;
  }
  void drive_for(double seconds) {
    for (int ms = 0; ms < seconds * 1000; ++ms) ASSERT_TRUE(pass()) << guard.why();
  }

  PodcarModel model;
  Podcar podcar;
  Course course;
  VirtualRobot robot;
  control::LoopGuard guard;

 private:
  void send(const Command& command) {
    EXPECT_NE(robot.session().send(command, std::chrono::seconds(1), robot.now()), 0U);
  }
  void on_state(const ReceivedState& state) {
    if (!begun_) return;
    const auto dt_s = guard.on_state(state, robot.session().disarmed_by(), robot.clock());
    if (!dt_s) return;
    std::optional<Setpoints> out;
    std::string why = "arrived";
    try {
      out = follow(podcar, course, state, *dt_s);
    } catch (const Error& error) {
      why = error.what();
    }
    if (!out) return guard.end(LoopEnd::asked, why);
    guard.on_commanded(*out);
    robot.session().post(*out, robot.now());
  }

  bool begun_ = false;
  bool rests_ = false;
};

Course straight() { return Course({{0, 0}, {100, 0}}); }

TEST(OpenPodcar, DrivesAFigureOfEight) {
  for (const std::uint64_t seed : {1U, 2U}) {
    PodcarRun run(Course::figure_of_eight(9), seed);
    double worst_m = 0, fastest_m_s = 0;
    int ms = 0;
    for (; ms < 90'000 && run.pass(); ++ms) {
      worst_m = std::max(worst_m, run.deviation());
      fastest_m_s = std::max(fastest_m_s, run.model.place().speed_m_s);
    }
    const double off_m = std::hypot(run.model.place().x_m, run.model.place().y_m);
    fmt::print(
        "eight of {:.1f} m in {:.1f} s, up to {:.2f} m/s: {:.3f} m beside it at most, {:.3f} m "
        "from its end\n",
        run.course.length_m(), ms / 1000.0, fastest_m_s, worst_m, off_m);
    EXPECT_EQ(run.guard.why(), "arrived");
    EXPECT_LE(worst_m, 0.15);
    EXPECT_LE(off_m, 0.25);
    EXPECT_NEAR(fastest_m_s, podcar_cruise_m_s, 0.05);
  }
}

TEST(OpenPodcar, PassesItsWaypoints) {
  const std::vector<Waypoint> waypoints = {{0, 0}, {6, 0}, {10, 4}, {10, 10}, {4, 12}};
  PodcarRun run{Course(waypoints)};
  std::vector<double> nearest_m(waypoints.size(), 1e9);
  for (int ms = 0; ms < 60'000 && run.pass(); ++ms) {
    for (std::size_t i = 0; i < waypoints.size(); ++i) {
      nearest_m[i] = std::min(nearest_m[i], std::hypot(run.model.place().x_m - waypoints[i].x_m,
                                                       run.model.place().y_m - waypoints[i].y_m));
    }
  }
  EXPECT_EQ(run.guard.why(), "arrived");
  for (const double each : nearest_m) {
    fmt::print("passed within {:.3f} m\n", each);
    EXPECT_LE(each, 0.4);
  }
  EXPECT_LE(nearest_m.back(), 0.25);
}

// An incident at 1 m/s.
struct Mishap {
  const char* name;
  void (*happen)(PodcarRun&);
  double reaction_s;  // until the board's outputs are safe
};

const Mishap mishaps[] = {
    {"handle let go", [](PodcarRun& run) { run.robot.model().hold_handle(false); }, 0.02},
    {"link lost", [](PodcarRun& run) { run.robot.link_cut = true; }, board_timeout_s + 0.02},
    {"host killed", [](PodcarRun& run) { run.robot.host_lives = false; }, board_timeout_s + 0.02},
};

TEST(OpenPodcar, StopsWithinItsBrakingDistanceAndOneTimeout) {
  for (const Mishap& mishap : mishaps) {
    PodcarRun run(straight());
    run.drive_for(5);
    const double speed = run.model.place().speed_m_s;
    EXPECT_NEAR(speed, podcar_cruise_m_s, 0.05);
    mishap.happen(run);
    const double rolled_m = run.rolls_m();
    const double allowed_m =
        PodcarModel::braking_distance_m(speed * 1.02) + speed * 1.02 * mishap.reaction_s;
    fmt::print("{}: {:.3f} m, of {:.3f} m that it may\n", mishap.name, rolled_m, allowed_m);
    EXPECT_LE(rolled_m, allowed_m) << mishap.name;
    EXPECT_GT(rolled_m, 0.1);
    EXPECT_TRUE(run.robot.model().pins().is_safe());
  }
}

TEST(OpenPodcar, StopsBeforeAWall) {
  PodcarRun run(straight());
  run.model.set_wall(12);
  run.drive_for(5);
  const double sensor_m = 12 - PodcarModel::nose_m - podcar_clearance_cm / 100.0;
  while (run.model.place().x_m < sensor_m && run.pass()) {
  }
  const double rolled_m = run.rolls_m();
  // Four sensors take turns, and two echoes must agree.
  const double allowed_m = PodcarModel::braking_distance_m(1.02) + 1.02 * 0.5;
  fmt::print("wall: {:.3f} m beyond the threshold of 1.5 m, of {:.3f} m\n", rolled_m, allowed_m);
  EXPECT_LE(rolled_m, allowed_m);
  EXPECT_EQ(run.robot.application().reason(), SafeReason::proximity);
}

TEST(OpenPodcar, StopsWhenItReceivesNoMoreStates) {
  PodcarRun run(straight());
  run.drive_for(5);
  run.robot.states_stop = true;
  const double rolled_m = run.rolls_m();
  const double allowed_m = PodcarModel::coasting_distance_m(1.02) + 1.02 * (0.15 + 0.02);
  fmt::print("states lost: {:.3f} m with the motor shorted, of {:.3f} m\n", rolled_m, allowed_m);
  EXPECT_EQ(run.guard.ended(), LoopEnd::late);
  EXPECT_LE(rolled_m, allowed_m);
}

TEST(OpenPodcar, DoesNotMoveAfterLinkAndHandleReturn) {
  PodcarRun run(straight());
  run.drive_for(5);
  run.robot.link_cut = true;
  run.robot.model().hold_handle(false);
  run.rolls_m();
  run.robot.link_cut = false;
  run.robot.model().hold_handle(true);
  const double stands_m = run.model.travelled_m();
  for (int ms = 0; ms < 3000; ++ms) run.pass();
  EXPECT_EQ(run.robot.session().link().state, HostLinkState::active);
  EXPECT_EQ(run.model.travelled_m(), stands_m);
}

TEST(OpenPodcar, StopsWhenTheSteeringSensorFails) {
  PodcarRun run(straight());
  run.drive_for(3);
  run.robot.model().pin_analog(Analog::ainsteer, 0);
  const double rolled_m = run.rolls_m();
  const double allowed_m = PodcarModel::coasting_distance_m(1.02) + 1.02 * 0.05;
  fmt::print("potentiometer off: {:.3f} m, of {:.3f} m\n", rolled_m, allowed_m);
  EXPECT_LE(rolled_m, allowed_m);
  EXPECT_NE(run.guard.why().find("AINSTEER"), std::string::npos) << run.guard.why();
}

// The clock does not show this restart: until the host connects again, the board runs longer than
// it ran before the restart.
TEST(OpenPodcar, KeepsItsPoseWhenTheBoardRestarts) {
  Podcar podcar;
  State state;
  state.raw.analog_cv[static_cast<int>(Analog::ainsteer)] = 250;
  const auto sense = [&](std::uint32_t t_ms, std::int32_t counts) {
    state.t_ms = t_ms;
    state.raw.encoder_counts[podcar_wheel.encoder - 1] = counts;
    EXPECT_TRUE(podcar.sense(state));
  };
  sense(60'000, 50'000);
  podcar.on_restart();
  sense(120'000, 0);
  EXPECT_EQ(podcar.pose().x_m, 0);
  sense(120'010, 20);
  EXPECT_GT(podcar.pose().x_m, 0) << "the pose continues from there";
}

}  // namespace
}  // namespace r4::simulation
