// SPDX-License-Identifier: GPL-3.0-or-later
// Drives an OpenPodcar by ROS 2, while a person holds the dead-man's handle: by a joystick, by
// cmd_vel, or to goals of RViz (pilot.hpp selects the source). ROS itself need not be installed.
//
//     openpodcar_ros2 [URL]     without a URL: a simulated board and a model of the vehicle
//
// The joystick's start button arms, and arms again after the end of a drive. Ctrl-C ends the
// program. Exit code: 0 ended, 2 usage, 3 refused, 4 no such transport or graph, 5 permission, 6
// not supported.
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <r4link/board.hpp>
#include <r4link/control/loop.hpp>
#include <r4link/error.hpp>
#include <r4link/simulation.hpp>
#include <string>
#include <utility>

#include "drive.hpp"
#include "model.hpp"
#include "pilot.hpp"
#include "podcar.hpp"
#include "topics.hpp"

using namespace std::chrono_literals;

namespace {

volatile std::sig_atomic_t ended = 0;

// False if the program ends before start is pressed. When the board restarts, run_loop() ends, so
// this function gets the first state after a restart. `restarts`: the known restarts of the board.
bool wait_for_start(r4::Board& board, Podcar& podcar, Pilot& pilot, Topics& topics,
                    std::uint32_t& restarts) {
  r4::States states = board.states();
  while (ended == 0 && pilot.mode() == Pilot::Mode::off) {
    const auto state = states.take(20ms);
    const std::uint32_t counted = board.statistics().packets.restarts;
    if (std::exchange(restarts, counted) != counted) podcar.on_restart();
    if (state && podcar.sense(*state)) topics.publish(podcar, *state);
    topics.take(pilot, podcar.pose());
  }
  return ended == 0;
}

// Returns at the end of the drive; pilot.why() has the reason.
void drive(r4::Board& board, Podcar& podcar, Pilot& pilot, Topics& topics) {
  arm_podcar(board);
  podcar.begin_drive();
  bool begun = false;
  std::puts("armed");
  const auto report = r4::control::run_loop(
      board, podcar_loop(), [&](const r4::control::LoopStep& step) -> std::optional<r4::Setpoints> {
        topics.take(pilot, podcar.pose());
        if (!begun) pilot.begin(Pilot::Time::clock::now());  // earlier messages are too old
        begun = true;
        const bool steering_is_known = podcar.sense(step.state);
        if (!steering_is_known) pilot.end("AINSTEER shows an angle that the steering cannot have");
        if (!podcar.obeys()) pilot.end("steering or speed is not as commanded");
        if (ended != 0) pilot.end("it was ended");
        topics.publish(podcar, step.state);
        const auto wish = pilot.wish(podcar.pose(), Pilot::Time::clock::now());
        if (wish) return podcar.drive(*wish, step.dt_s);
        board.stop_async();  // cuts the motors' supply at once, which applies the parking brake
        return std::nullopt;
      });
  board.stop_async();
  pilot.end(report.why);
}

void run(r4::Board& board) {
  Topics topics;
  Podcar podcar;
  Pilot pilot;
  board.wait_active();
  guard_podcar(board);  // before arm(): an obstacle prevents arming
  std::puts("hold the handle, and press the joystick's start");
  std::uint32_t restarts = 0;
  while (wait_for_start(board, podcar, pilot, topics, restarts)) {
    try {
      drive(board, podcar, pilot, topics);
    } catch (const r4::Error& error) {  // the board did not answer, or refused
      board.stop_async();
      pilot.end(error.what());
    }
    const r4::control::Pose& pose = podcar.pose();
    std::printf("stopped at %.2f, %.2f: %s\n", pose.x_m, pose.y_m, pilot.why().c_str());
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    // A signal that is ignored at the start stays ignored, as SIGHUP under nohup.
    if (std::signal(signal, [](int) { ended = 1; }) == SIG_IGN) std::signal(signal, SIG_IGN);
  }
  try {
    if (argc > 2) {
      throw r4::Error(r4::ErrorKind::usage, argv[2], "it takes one URL", "give no more");
    }
    r4::BoardOptions options;
    options.session.fields = podcar_fields;
    PodcarModel model;
    r4::sim::SimulatedRobot robot(model);
    r4::Board board(argc == 2 ? argv[1] : robot.url(), options);
    run(board);
    return 0;
  } catch (const r4::Error& error) {  // the thing, the reason and the fix
    std::fprintf(stderr, "openpodcar_ros2: %s\n", error.what());
    return static_cast<int>(error.kind());
  }
}
