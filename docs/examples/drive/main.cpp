// SPDX-License-Identifier: GPL-3.0-or-later
// Accelerates OSMC channel 1 and slows it down again, prints the events and the counts of the
// motor's encoder. When the program ends, the board switches all outputs off.
//
//     drive [URL]        sim: without a URL; udp://192.168.0.125, serial:auto …
//
// Exit code: 0 done, 2 usage, 3 refused or timed out, 4 no such transport, 5 permission,
// 6 not supported here.
#include <chrono>
#include <cstdio>
#include <r4link/board.hpp>
#include <r4link/error.hpp>
#include <thread>

using namespace std::chrono_literals;

namespace {

// Runs on the callbacks' thread.
void print_link(const r4::LinkStatus& link) {
  std::printf("link: %s%s%s%s\n", r4::to_text(link.state),
              link.state == r4::HostLinkState::safe ? ", reason " : "",
              link.state == r4::HostLinkState::safe ? r4::to_text(link.reason) : "",
              link.gated() ? ", our heartbeats have stopped" : "");
}

void print_state(const r4::State& state) {
  std::printf("state: %6.2f V, OSMC 1 at %4u %s\n", state.volts(r4::Analog::ain24),
              state.osmc(1).pwm,
              state.osmc(1).direction == r4::Direction::forward ? "forward" : "reverse");
}

void drive(r4::Board& board) {
  board.on_link(print_link);
  board.on_state([last = r4::Drive{}](const r4::State& state) mutable {
    if (state.osmc(1) == last) return;  // the board sends 100 states a second
    last = state.osmc(1);
    print_state(state);
  });

  board.wait_active();
  const r4::BoardIdentity who = board.identify();
  std::printf("board %s, firmware %s, on %s\n", who.board_id.c_str(), who.firmware.c_str(),
              board.name().c_str());

  // Encoder 1 is on the motor's shaft.
  board.fields("DEFAULT,ENC1");
  const std::int32_t from = board.next_state().encoder(1);

  // If this program does not call feed() for 300 ms, the heartbeats stop and the board switches its
  // outputs off.
  board.watchdog(300ms);
  // Closes relay 1, which gives the motors their supply. Before arm(), and again after a safe
  // state, relay 1 is open, and commands that drive an output are refused.
  board.arm(250ms);
  board.feed();
  for (const double duty : {0.0, 0.1, 0.2, 0.3, 0.2, 0.1, 0.0}) {
    board.osmc(1).set(duty, 250ms);  // returns when a state confirms the command
    board.feed();
    std::this_thread::sleep_for(50ms);
  }

  std::printf("motor 1 has turned by %d counts\n", board.next_state(250ms).encoder(1) - from);

  const r4::Statistics statistics = board.statistics();
  std::printf("%llu states, %.1f a second, %.0f us round trip, %.1f %% lost\n",
              static_cast<unsigned long long>(statistics.states), statistics.state_rate_hz,
              statistics.round_trip_us, statistics.loss() * 100);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    r4::Board board(argc > 1 ? argv[1] : "sim:");
    drive(board);
  } catch (const r4::Error& error) {  // the thing, the reason and the fix
    std::fprintf(stderr, "drive: %s\n", error.what());
    return static_cast<int>(error.kind());
  }
}
