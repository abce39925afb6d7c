// SPDX-License-Identifier: GPL-3.0-or-later
// The user's I2C bus on the processor: its readings are right, and the board does not wait for the
// bus.
#include <initializer_list>

#include "board_bench.hpp"

namespace {

using namespace r4;
using namespace r4::m7;
using Fault = sim::UserBusModel::Fault;

// One device with 14 bytes at 100 Hz, and seven readings at 20 Hz.
void read_all(Bench& host) {
  host.execute(Command::i2c_write(0x68, "x6b00"));
  host.execute(Command::i2c_poll(1, 0x68, "x3b", 14, 10));
  for (int slot = 2; slot <= i2c_slots; ++slot) {
    host.execute(Command::i2c_poll(slot, 0x40, "x02", 2, 50));
  }
}

struct Longest {
  std::uint32_t stop_us = 0;
  std::uint32_t silence_ms = 0;
};

// Checks the states, the reaction to silence and a stop while `trouble` disturbs the user's bus.
template <class Trouble>
void expect_unhindered(Trouble trouble, Longest& longest) {
  Bench& host = new_board();
  const Stepping steps(step_of_board);
  host.drive_everything();
  Listener& listener = host.listen();
  trouble(host);
  host.run_alive_ms(100);
  listener.forget();
  host.run_alive_ms(200);
  EXPECT(listener.states() >= 19 && listener.lost() == 0 && listener.longest_step_ms() == 10);
  EXPECT(!host.safe());

  host.run_ms(timeout_ms + 10);
  const std::uint32_t silence_ms = host.now_ms() - host.board().application().link().fed_ms();
  EXPECT(host.safe() && host.reason() == SafeReason::link);
  const std::uint32_t safe_ms =
      silence_ms - (BoardClock::ticks() - host.safe_ticks()) / BoardClock::ticks_per_us / 1000;
  if (safe_ms > longest.silence_ms) longest.silence_ms = safe_ms;

  host.drive_everything();  // a paper host begins a new session
  EXPECT(!host.safe());
  host.command(Command::stop());
  host.run_ms(5);
  const std::uint32_t took = (host.safe_ticks() - host.line_end_ticks()) / BoardClock::ticks_per_us;
  EXPECT(host.safe() && host.reason() == SafeReason::stop);
  if (took > longest.stop_us) longest.stop_us = took;
}

}  // namespace

TEST(Devices, AreReadAndReportedWithTheirTime) {
  Bench& host = new_board();
  const Stepping steps(step_of_board);
  host.heartbeat();
  host.run_ms(2);
  Listener& listener = host.listen();
  host.execute(Command::fields("I2C1,I2C8,I2CBUS"));
  read_all(host);
  host.run_alive_ms(200);
  const State& state = listener.state();
  EXPECT(state.raw.i2c[0].data.size == 14 && state.raw.i2c[0].data.bytes[4] == 0x40);
  EXPECT(state.raw.i2c[7].data.size == 2 && state.raw.i2c[7].data.bytes[1] == 0x02);
  EXPECT(state.t_ms - state.raw.i2c[0].t_ms <= 13 && state.i2c_bus.errors == 0);
}

// The bus is free, held, or stretches the clock endlessly.
TEST(Devices, AHeldBusDoesNotDelayTheBoard) {
  Longest longest;
  for (const Fault fault : {Fault::none, Fault::held, Fault::stretched}) {
    expect_unhindered(
        [fault](Bench& host) {
          read_all(host);
          host.model().devices().bus.set_fault(fault);
        },
        longest);
  }
  on_target::say_number("us from a stop to safe, the user's bus held", longest.stop_us);
  on_target::say_number("ms of silence until safe, the user's bus held", longest.silence_ms);
  EXPECT(longest.stop_us <= 2000 && longest.silence_ms <= timeout_ms + 3);
}

TEST(Devices, NoiseOnTheUartsAtFullRateDoesNotDelayTheBoard) {
  Longest longest;
  expect_unhindered(
      [](Bench& host) {
        host.execute(Command::fields("UART1,UART2"));
        host.execute(Command::setting("uart1", "460800:8N1"));
        host.execute(Command::setting("uart2", "460800:8N1"));
        for (sim::UserUartModel& uart : host.model().devices().uarts) {
          uart.connect(sim::UartPeer::noise);
        }
      },
      longest);
  EXPECT(bench->model().devices().uarts[1].said() > 10000);
  on_target::say_number("us from a stop to safe, noise on the UARTs", longest.stop_us);
  on_target::say_number("ms of silence until safe, noise on the UARTs", longest.silence_ms);
  EXPECT(longest.stop_us <= 2000 && longest.silence_ms <= timeout_ms + 3);
}

TEST(Devices, AUartIsReceivedAndAStopZeroesADacVoltage) {
  Bench& host = new_board();
  const Stepping steps(step_of_board);
  host.heartbeat();
  host.run_ms(2);
  Listener& listener = host.listen();
  host.execute(Command::fields("UART1,DAC1,GPIO"));
  host.execute(Command::setting("uart1", "115200:8N1"));
  host.execute(Command::dac(1, Millivolts(1650)));
  host.run_alive_ms(300);
  const State& state = listener.state();
  EXPECT(state.raw.uart[0].position > 300 && state.raw.uart[0].lost == 0);
  EXPECT(state.raw.dac_mv[0] == 1650 && host.model().dac_mv(1) == 1650 && state.gpio == 0xFF);
  host.command(Command::stop());
  host.run_ms(3);
  EXPECT(host.model().dac_mv(1) == 0);
}
