// SPDX-License-Identifier: GPL-3.0-or-later
// The states of the whole board on the processor: its inputs, the interlocks that use these inputs,
// and the highest rate of states.
#include "board_bench.hpp"

namespace {

using namespace r4;
using namespace r4::m7;

// Whole turns and a part of a turn, different for each encoder. Encoders 2 and 4 turn backwards.
std::int32_t turns_of(int channel) {
  return (channel % 2 == 0 ? -channel : channel) * sim::BoardModel::counts_a_turn;
}
std::int32_t part_of(int channel) { return channel % 2 == 0 ? -7 * channel : 7 * channel; }

struct Heard {
  Heard() : host(new_board()), steps(step_of_board), told(host.listen()) {
    host.heartbeat();
    host.run_ms(20);
  }
  const State& state() const { return told.state(); }

  Bench& host;
  const Stepping steps;
  Listener& told;
};

}  // namespace

TEST(BoardState, ReportsEveryInputExactly) {
  Heard board;
  board.host.execute(Command::fields("ALL"));
  for (int i = 0; i < analog_channels; ++i) {
    board.host.model().pin_analog(static_cast<Analog>(i), 100 * (i + 1) + i);
  }
  for (int channel = 1; channel <= 4; ++channel) {
    board.host.model().turn_encoder(channel, turns_of(channel) + part_of(channel));
    board.host.model().set_ultrasonic(channel, static_cast<std::uint16_t>(50 * channel));
  }
  board.host.execute(Command::stepper(3, Steps(50), StepsPerSecond(5000)));
  board.host.run_alive_ms(700);  // long enough to read every sensor
  const State& state = board.state();
  EXPECT(state.handle_held() && state.raw.stepper_steps[2] == 50);
  for (int i = 0; i < analog_channels; ++i) EXPECT(state.raw.analog_cv[i] == 100 * (i + 1) + i);
  for (int channel = 1; channel <= 4; ++channel) {
    EXPECT(state.raw.ultrasonic_cm[channel - 1] == 50 * channel);
    EXPECT(state.raw.encoder_counts[channel - 1] == turns_of(channel) + part_of(channel));
    EXPECT(state.raw.encoder_index_counts[channel - 1] == turns_of(channel));
    EXPECT(state.raw.encoder_hz[channel - 1] == 0);
  }
  board.host.execute(Command::setting("AIN24", "55.00"));
  for (int channel = 1; channel <= 4; ++channel) board.host.execute(Command::zero(channel));
  board.host.run_alive_ms(100);
  EXPECT(state.raw.analog_cv[0] == 110 && state.raw.analog_cv[1] == 201 &&
         state.raw.stepper_steps[2] == 0);
  for (int channel = 1; channel <= 4; ++channel) {
    EXPECT(state.raw.encoder_counts[channel - 1] == 0);
    EXPECT(state.raw.encoder_index_counts[channel - 1] == -part_of(channel));
  }
  board.host.execute(Command::relay(1, true));  // switches the supply of the motors on
  for (int channel = 1; channel <= 4; ++channel) {
    board.host.execute(Command::osmc(channel, Pwm(1000 * channel), Direction::forward));
  }
  board.host.run_alive_ms(2000);
  for (int channel = 1; channel <= 4; ++channel) {
    const std::int32_t off = state.raw.encoder_hz[channel - 1] - 977 * channel;  // 4000 at 4095
    EXPECT(-20 <= off && off <= 20);
  }
  EXPECT(board.told.lost() == 0 && board.told.bad() == 0);
}

TEST(BoardState, AReleasedHandleSwitchesEverythingOff) {
  Heard board;
  board.host.drive_everything();
  EXPECT(!board.host.safe() && board.host.pins().relays == 0xFF);
  board.host.model().hold_handle(false);
  const std::uint32_t released = BoardClock::ticks();
  board.host.run_ms(20);
  const std::uint32_t after_us = (board.host.safe_ticks() - released) / BoardClock::ticks_per_us;
  on_target::say_number("us from the handle's release to safe", after_us);
  EXPECT(board.host.safe() && after_us <= 12000);
  EXPECT(board.host.reason() == SafeReason::handle);
  EXPECT(board.state().safe == SafeReason::handle && !board.state().handle_held());
  board.host.model().hold_handle(true);
  board.host.run_alive_ms(100);
  EXPECT(board.host.reason() == SafeReason::none && board.state().handle_held());
  EXPECT(board.host.chips_are_safe());  // until the next command
  board.host.execute(Command::relay(1, true));
  EXPECT(board.host.pins().relays == 1);
}

TEST(BoardState, AnObstacleAtAnySensorSwitchesEverythingOff) {
  Heard board;
  for (int channel = 1; channel <= ultrasonic_channels; ++channel) {
    board.host.execute(Command::proximity(channel, Centimetres(60)));
    board.host.run_alive_ms(300);
    board.host.drive_everything();
    EXPECT(!board.host.safe());
    board.host.model().set_ultrasonic(channel, 30);
    board.host.run_alive_ms(260);
    EXPECT(board.host.safe() && board.host.chips_are_safe());
    EXPECT(board.host.reason() == SafeReason::proximity);
    EXPECT(board.state().safe == SafeReason::proximity);
    board.host.model().set_ultrasonic(channel, 0);
    board.host.run_alive_ms(900);
    EXPECT(board.host.reason() == SafeReason::none && board.host.chips_are_safe());
    board.host.execute(Command::proximity(channel, Centimetres(0)));
  }
}

// The board's clock and counters measure the states. An instruction takes 8 ns here, however busy
// the machine is.
TEST(BoardState, StreamsAt1000HzOverUdpWithNothingLostOrLeftOut) {
  Heard board;
  board.host.execute(Command::fields("DEFAULT,LATE"));
  board.host.execute(Command::osmc(1, Pwm(1000), Direction::forward));
  board.host.execute(Command::setting("rate", "1000"));
  board.host.run_alive_ms(100);
  constexpr std::uint32_t streamed_ms = 5000;
  const std::uint32_t late = board.state().late;
  const std::uint32_t first_ms = board.state().t_ms;
  board.told.forget();
  board.host.run_alive_ms(streamed_ms);
  const std::uint32_t passed_ms = board.state().t_ms - first_ms;
  on_target::say_number("states in 5 s at 1000 Hz", board.told.states());
  on_target::say_number("of them left out", board.state().late - late);
  EXPECT(passed_ms >= streamed_ms && board.told.states() == passed_ms);
  EXPECT(board.state().late == late && board.told.longest_step_ms() == 1);
  EXPECT(board.told.lost() == 0 && board.told.bad() == 0);
}
