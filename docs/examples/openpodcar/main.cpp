// SPDX-License-Identifier: GPL-3.0-or-later
// Drives an OpenPodcar along a course, while a person holds the dead-man's handle.
//
//     openpodcar [URL] [X,Y …]     metres from the start: x forward, y to the left. Without
//                                  waypoints: a figure of eight. Without a URL: a simulated board
//                                  and a model of the vehicle
//
// Enter begins, Ctrl-C ends. Exit code: 0 arrived, 2 usage, 3 the vehicle stopped before the end,
// or the board refused a command, 4 no such transport, 5 permission, 6 not supported.
#include <termios.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <optional>
#include <r4link/board.hpp>
#include <r4link/control/loop.hpp>
#include <r4link/error.hpp>
#include <r4link/simulation.hpp>
#include <string>
#include <utility>
#include <vector>

#include "course.hpp"
#include "drive.hpp"
#include "model.hpp"
#include "podcar.hpp"

using namespace std::chrono_literals;

namespace {

volatile std::sig_atomic_t ended = 0;

std::optional<Waypoint> waypoint_of(const std::string& text) {
  Waypoint waypoint;
  int read = 0;
  const int numbers = std::sscanf(text.c_str(), "%lf,%lf%n", &waypoint.x_m, &waypoint.y_m, &read);
  if (numbers != 2 || static_cast<std::size_t>(read) != text.size()) return std::nullopt;
  return waypoint;
}

void say(double time_s, const Podcar& podcar, const Course& course) {
  const r4::control::Pose& pose = podcar.pose();
  std::printf("%5.1f s  x %6.2f m  y %6.2f m  %5.2f m/s  steering %5.2f rad  %5.2f m beside\n",
              time_s, pose.x_m, pose.y_m, podcar.speed_m_s(), podcar.steering_rad(),
              course.deviation_m(pose.x_m, pose.y_m));
}

// False if the user ends the program before the drive.
bool wait_for_enter(const Course& course) {
  tcflush(STDIN_FILENO, TCIFLUSH);  // earlier input must not begin the drive
  std::printf("hold the handle, and press Enter to drive %.1f m\n", course.length_m());
  int key = std::getchar();
  while (key != '\n' && key != EOF) key = std::getchar();
  return key != EOF && ended == 0;
}

int drive(r4::Board& board, Course& course, const r4::control::Pose& start) {
  board.wait_active();
  guard_podcar(board);  // before arm(): an obstacle prevents arming
  if (!wait_for_enter(course)) return 0;
  arm_podcar(board);

  Podcar podcar;
  podcar.begin_at(start);
  double time_s = 0, told_s = 0;
  const auto report = r4::control::run_loop(
      board, podcar_loop(), [&](const r4::control::LoopStep& step) -> std::optional<r4::Setpoints> {
        const auto wish = follow(podcar, course, step.state, step.dt_s);
        time_s += step.dt_s;
        if (time_s >= told_s) {
          say(time_s, podcar, course);
          told_s += 1;
        }
        return ended != 0 ? std::nullopt : wish;
      });
  say(time_s, podcar, course);
  const bool arrived = report.end == r4::control::LoopEnd::asked && course.finished();
  std::printf("%s\n", arrived ? "arrived" : report.why.c_str());
  return arrived ? 0 : static_cast<int>(r4::ErrorKind::refused);
}

}  // namespace

int main(int argc, char** argv) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  struct sigaction action {};
  action.sa_handler = [](int) {
    ended = 1;
  };  // without SA_RESTART: a signal also ends the wait for Enter
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction before {};
    sigaction(signal, nullptr, &before);
    // An ignored signal stays ignored, such as SIGHUP under nohup.
    if (before.sa_handler != SIG_IGN) sigaction(signal, &action, nullptr);
  }
  try {
    std::string url;
    std::vector<Waypoint> waypoints = {{0, 0}};
    for (int i = 1; i < argc; ++i) {
      if (const auto waypoint = waypoint_of(argv[i])) {
        waypoints.push_back(*waypoint);
      } else if (i == 1) {
        url = argv[i];
      } else {
        throw r4::Error(r4::ErrorKind::usage, argv[i], "it is not a waypoint",
                        "give metres: 5,0 7.5,-2");
      }
    }
    const bool eight = waypoints.size() == 1;
    Course course = eight ? Course::figure_of_eight(9) : Course(std::move(waypoints));
    r4::control::Pose start;
    if (eight) start.yaw_rad = course.heading_rad();
    r4::BoardOptions options;
    options.session.fields = podcar_fields;
    PodcarModel model;
    r4::sim::SimulatedRobot robot(model);
    r4::Board board(url.empty() ? robot.url() : url, options);
    return drive(board, course, start);
  } catch (const r4::Error& error) {  // what(): the thing, the reason and the fix
    std::fprintf(stderr, "openpodcar: %s\n", error.what());
    return static_cast<int>(error.kind());
  }
}
