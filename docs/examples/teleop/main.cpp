// SPDX-License-Identifier: GPL-3.0-or-later
// Drives a robot with two motors (OSMC 1 left, 2 right) by hand, streaming setpoints.
//
//     teleop [URL]       sim: without a URL; udp://192.168.0.125, serial:auto …
//
//     e       arm: the motors get their supply; nothing moves yet
//     c       clear a stop from before this program began; nothing moves
//     w s     forward, backward      a d     turn left, right        as long as the key is held
//     space   emergency stop         q       stop and end            any other key: stand still
//
// After each safe state press e again. Exit code: 0 done, 2 usage, 3 refused, timed out or the stop
// was not confirmed (then cut the power), 4 no such transport, 5 permission, 6 not supported.
#include <chrono>
#include <csignal>
#include <cstdio>
#include <r4link/board.hpp>
#include <r4link/error.hpp>
#include <r4link/link.hpp>

#include "keyboard.hpp"

using namespace std::chrono_literals;

namespace {

using Clock = std::chrono::steady_clock;

constexpr double speed = 0.15;  // of full speed
constexpr auto period = 20ms;
// The terminal repeats a held key, the first time after about half a second.
constexpr auto hold = 700ms;
// If this program hangs for longer, its heartbeats stop and the board switches its outputs off.
constexpr auto watchdog = 500ms;
constexpr auto patience = 300ms;  // longest wait for the board, below the watchdog's time

volatile std::sig_atomic_t ended = 0;

struct Setpoint {
  double left = 0;
  double right = 0;
};

// The setpoint of the pressed keys; none after the keys are released.
class Hand {
 public:
  void press(char key, Clock::time_point now) {
    until_ = now + hold;
    switch (key) {
      case 'w':
        wanted_ = {speed, speed};
        break;
      case 's':
        wanted_ = {-speed, -speed};
        break;
      case 'a':
        wanted_ = {-speed, speed};
        break;
      case 'd':
        wanted_ = {speed, -speed};
        break;
      default:
        wanted_ = {};
    }
  }
  void let_go() { wanted_ = {}; }
  Setpoint setpoint(Clock::time_point now) const { return now < until_ ? wanted_ : Setpoint{}; }

 private:
  Setpoint wanted_;
  Clock::time_point until_;
};

// Sends the newest setpoints of both motors once, as a group. If they cannot be sent, they are
// dropped: newer setpoints follow after 20 ms.
r4::PostResult post(r4::Board& board, const Setpoint& setpoint) {
  return board.post(r4::Setpoints{r4::Command::osmc(1, r4::Duty(setpoint.left)),
                                  r4::Command::osmc(2, r4::Duty(setpoint.right))});
}

void say_why(r4::Board& board, r4::PostResult result) {
  if (result == r4::PostResult::sent) {
    std::printf("armed: w a s d drive, space stops\n");
  } else if (result == r4::PostResult::not_armed) {
    const r4::DisarmCause cause = board.disarmed_by();
    const char* const keys = r4::is_earlier(cause) ? "c, then e" : "e";
    std::printf("not armed (%s): press %s\n", r4::to_text(cause), keys);
  } else {
    std::printf("not sent: %s\n", r4::to_text(result));
  }
}

// `act` may fail, for example because the handle is released or an obstacle is near.
template <class Act>
void attempt(Act act) {
  try {
    act();
  } catch (const r4::Error& error) {
    std::printf("%s\n", error.what());
  }
}

void stop(r4::Board& board) {
  board.stop(patience);  // throws if the board does not confirm the stop
  std::printf("stopped\n");
}

void teleoperate(r4::Board& board, Keyboard& keyboard) {
  // The callback runs on a separate thread.
  board.on_refused([](const r4::RefusedPost& refused) {
    std::printf("refused by the board or on the way: OSMC %d\n", refused.command.channel);
  });
  board.next_state(3s);  // the board is connected; a stop may be latched
  // After a lost link motors stay off until e is pressed, because the driver may not see the robot.
  board.setting("recovery", "rearm");
  board.watchdog(watchdog);
  std::printf("e arms, q ends\n");

  Hand hand;
  bool told = false;
  r4::PostResult last = r4::PostResult::sent;
  auto cause = r4::DisarmCause::none;
  while (ended == 0 && !keyboard.at_end()) {
    const std::optional<char> key = keyboard.key(period);
    board.feed();
    if (key == 'q') break;
    if (key == ' ') stop(board);
    if (key == 'c') attempt([&] { board.send(r4::Command::clear(), patience); });
    if (key == 'e') attempt([&] { board.arm(patience); });
    if (key) hand.press(*key, Clock::now());

    const r4::PostResult result = post(board, hand.setpoint(Clock::now()));
    if (!result) hand.let_go();  // so that arming moves nothing
    if (!told || result != last || board.disarmed_by() != cause) {
      say_why(board, result);
      told = true;
      last = result;
      cause = board.disarmed_by();
    }
  }
  stop(board);
}

}  // namespace

int main(int argc, char** argv) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    // A signal that is ignored at the start stays ignored, as SIGHUP under nohup.
    if (std::signal(signal, [](int) { ended = 1; }) == SIG_IGN) std::signal(signal, SIG_IGN);
  }
  try {
    Keyboard keyboard;
    r4::Board board(argc > 1 ? argv[1] : "sim:");
    teleoperate(board, keyboard);
  } catch (const r4::Error& error) {  // the thing, the reason and the fix
    std::fprintf(stderr, "teleop: %s\n", error.what());
    return static_cast<int>(error.kind());
  }
}
