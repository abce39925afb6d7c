// SPDX-License-Identifier: GPL-3.0-or-later
// The whole board on the processor, with interrupts in the middle of its transfers.
#include "board_bench.hpp"

namespace {

using namespace r4;
using namespace r4::m7;

void wait_us(std::uint32_t us) {
  const std::uint32_t began = BoardClock::ticks();
  while (us_since(began) < us) {
  }
}

// Separate from the test, whose frame would hold the pins while the board runs on the same stack.
__attribute__((noinline)) void expect_everything_driven(Bench& host) {
  const sim::ChipPins pins = host.pins();
  for (int i = 0; i < 4; ++i) {
    EXPECT(pins.osmc[i].pwm == 1001 + i && pins.osmc[i].direction == Direction::forward);
    EXPECT(pins.dhb12[i].pwm == 2001 + i && pins.dhb12[i].direction == Direction::forward);
    EXPECT(pins.bldc[i].speed == 3001 + i && !pins.bldc[i].brake);
    EXPECT(host.board().model().pins().stepper[i].position > 0);
  }
  for (int i = 0; i < servo_channels; ++i) {
    const int off = pins.servo_us[i] - (700 + 100 * i);
    EXPECT(-3 <= off && off <= 3);
  }
  EXPECT(pins.relays == 0xFF);
}

__attribute__((noinline)) std::uint8_t relays_of(Bench& host) { return host.pins().relays; }

}  // namespace

TEST(Board, EveryCommandReachesItsPins) {
  Bench& host = new_board();
  const Stepping steps(step_of_board);
  host.drive_everything();
  expect_everything_driven(host);
  EXPECT(host.feedings() > 30);
  for (int i = 1; i <= relay_channels; ++i) {
    host.execute(Command::relay(i, false));
    EXPECT(relays_of(host) == static_cast<std::uint8_t>(0xFF << i));
  }
}

namespace {

// The times at which the wheels, the four OSMC channels, change.
struct Wheels {
  std::uint32_t first_ticks = 0;
  std::uint32_t last_ticks = 0;
  int changed = 0;
  void look() {
    const sim::ChipPins pins = bench->pins();
    int now = 0;
    for (const Drive& drive : pins.osmc) now += drive.pwm == 358 ? 1 : 0;
    if (now == changed) return;
    if (changed == 0) first_ticks = BoardClock::ticks();
    last_ticks = BoardClock::ticks();
    changed = now;
  }
};
Wheels wheels;

}  // namespace

TEST(Board, AGroupMovesFourWheelsAtOnce) {
  Bench& host = new_board();
  wheels = Wheels();
  const Stepping steps([] {
    bench->step();
    wheels.look();
  });
  host.heartbeat();
  host.run_ms(2);
  char buffer[max_datagram];
  DatagramWriter writer(buffer, sizeof buffer);
  for (int i = 1; i <= osmc_channels; ++i) {
    write_command(writer, Command::osmc(i, Pwm(358), Direction::forward));
  }
  host.send(writer);
  host.run_ms(5);
  const std::uint32_t skew_us = (wheels.last_ticks - wheels.first_ticks) / BoardClock::ticks_per_us;
  on_target::say_number("us from the first of four wheels to the last", skew_us);
  EXPECT(wheels.changed == 4 && skew_us <= 1000);
}

TEST(Board, TheSafeStateHoldsAfterItCutsAnyTransferShort) {
  Bench& host = new_board();
  std::uint32_t cut = 0;
  for (std::uint32_t at_us = 1; at_us < 1200; at_us += 31) {
    firmware::BoardHardware& hal = host.board().hal();
    firmware::Outputs outputs;
    outputs.osmc[0] = {static_cast<std::uint16_t>(at_us), Direction::forward};
    for (int i = 0; i < 4; ++i) outputs.bldc[i] = {1000, Direction::forward, false};
    for (std::uint16_t& us : outputs.servo_us) us = 1500;
    outputs.relays = 0xFF;
    const std::uint32_t cut_before = host.cut();
    {
      static bool done = false;
      done = false;
      const Stepping steps(
          [] {
            if (!done) bench->board().hal().make_safe();
            done = true;
          },
          at_us);
      hal.apply(outputs);
      hal.poll(host.now_ms() * 1000);
      while (!done) {
      }
    }
    EXPECT(host.chips_are_safe());
    EXPECT(!hal.fault().any());
    for (int i = 0; i < 10; ++i) hal.poll((host.now_ms() + static_cast<std::uint32_t>(i)) * 1000);
    wait_us(2000);
    EXPECT(host.chips_are_safe() && hal.ready() && !hal.fault().any());
    cut += host.cut() != cut_before ? 1 : 0;
  }
  on_target::say_number("transfers that were cut short", cut);
  EXPECT(cut >= 20);
}

TEST(Board, TheTimerMakesAHungLoopSafeAndTheWatchdogIsNotFed) {
  Bench& host = new_board();
  const Stepping steps(step_of_board);
  host.drive_everything();
  host.heartbeat();
  host.run_ms(2);
  EXPECT(!host.safe());
  const std::uint32_t hung = BoardClock::ticks();
  const std::uint32_t feedings = host.feedings();
  while (!host.safe() && us_since(hung) < 500000) {
  }
  const std::uint32_t after_us = (host.safe_ticks() - hung) / BoardClock::ticks_per_us;
  on_target::say_number("us from the loop's last turn to safe", after_us);
  EXPECT(host.safe() && after_us > 5 * 20000 - 2000 && after_us < 5 * 20000 + 5000);
  EXPECT(host.feedings() - feedings <= 1);
  host.run_ms(5);
  EXPECT(host.board().application().reason() == SafeReason::watchdog);
  EXPECT(host.chips_are_safe());
}

TEST(Board, TheTimerInterruptNoticesSilenceWhileTheLoopIsBusy) {
  Bench& host = new_board();
  const Stepping steps(step_of_board);
  host.drive_everything();
  host.heartbeat();
  host.run_ms(2);
  const std::uint32_t fed_ms = host.board().application().link().fed_ms();
  const std::uint32_t began = BoardClock::ticks();
  while (!host.safe() && us_since(began) < 500000) {
    host.board().application().guard().check_in(firmware::Application::loop_duty);
  }
  const std::uint32_t silence_ms = host.now_ms() - fed_ms;
  on_target::say_number("ms of silence until safe, with a timeout of 200", silence_ms);
  EXPECT(host.safe() && silence_ms >= timeout_ms && silence_ms <= timeout_ms + 3);
  // The first turn after the standstill takes 8 ms. After this turn the board has detected that the
  // line is empty.
  host.run_ms(20);
  EXPECT(host.board().application().reason() == SafeReason::link);
  // A paper host that reconnects begins a new session.
  host.heartbeat();
  host.run_ms(20);
  EXPECT(host.board().application().reason() == SafeReason::none && host.pins().relays == 0);
}

// E:STOP at each moment while all outputs are written again, which is the busiest time of the bus.
TEST(Board, AStopTakesEffectWithinTwoMilliseconds) {
  Bench& host = new_board();
  const Stepping steps(step_of_board);
  std::uint32_t longest_us = 0;
  for (std::uint32_t at_us = 0; at_us < 6000; at_us += 370) {
    host.execute(Command::clear(host.board().application().safe_report().cause));
    host.drive_everything();
    host.run_ms(timeout_ms + 10);
    EXPECT(host.safe());
    host.heartbeat();  // the board writes all outputs again
    while (!host.line_has_come()) host.board().turn();
    const std::uint32_t resumed = BoardClock::ticks();
    bool sent = false;
    while (!sent || !host.line_has_come() || !host.safe()) {
      if (!sent && us_since(resumed) >= at_us) {
        host.command(Command::stop());
        sent = true;
      }
      host.board().turn();
      if (us_since(resumed) > 100000) break;
    }
    EXPECT(host.safe());
    const std::uint32_t took =
        (host.safe_ticks() - host.line_end_ticks()) / BoardClock::ticks_per_us;
    if (took > longest_us && took < 100000) longest_us = took;
    host.run_ms(5);
    EXPECT(host.chips_are_safe() && host.board().application().reason() == SafeReason::stop);
  }
  on_target::say_number("us from a stop's last byte to the last safe register, at most",
                        longest_us);
  EXPECT(longest_us <= 2000);
}
