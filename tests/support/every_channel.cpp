// SPDX-License-Identifier: GPL-3.0-or-later
#include "every_channel.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <chrono>

namespace r4::test {

namespace {

constexpr std::chrono::seconds channel_patience{10};  // long enough for a busy machine

sim::Pins pins_of(const ControlledBoard& board) {
  sim::Pins pins;
  board.at_board([&](sim::SimulatedBoard& at) { pins = at.model().pins(); });
  return pins;
}

// The first state for which `is_so` is true. If there is no such state: the last state.
State await(const ControlledBoard& board, const std::function<bool(const State&)>& is_so) {
  State state;
  for (int tries = 0; tries < 1000; ++tries) {
    state = board.next_state();
    if (is_so(state)) return state;
  }
  ADD_FAILURE() << "the expected state did not come";
  return state;
}

// Whole turns and a part of a turn, different for each encoder. Encoders 2 and 4 turn backwards.
std::int32_t turns_of(int channel) {
  return (channel % 2 == 0 ? -channel : channel) * sim::BoardModel::counts_a_turn;
}
std::int32_t part_of(int channel) { return channel % 2 == 0 ? -100 * channel : 100 * channel; }

void expect_inputs(const ControlledBoard& board) {
  board.at_board([](sim::SimulatedBoard& at) {
    for (int i = 0; i < analog_channels; ++i) {
      at.model().pin_analog(static_cast<Analog>(i), 100 * (i + 1) + i);
    }
    for (int channel = 1; channel <= encoder_channels; ++channel) {
      at.model().turn_encoder(channel, turns_of(channel) + part_of(channel));
    }
    for (int channel = 1; channel <= ultrasonic_channels; ++channel) {
      at.model().set_ultrasonic(channel, static_cast<std::uint16_t>(50 * channel));
    }
  });
  const State state = await(board, [](const State& s) { return s.distance_cm(4) == 200; });
  const State again = await(board, [&](const State& s) {  // every sensor was read after the change
    return s.t_ms - state.t_ms > 250;
  });
  EXPECT_TRUE(again.handle_held());
  for (int i = 0; i < analog_channels; ++i) EXPECT_EQ(again.raw.analog_cv[i], 100 * (i + 1) + i);
  for (int channel = 1; channel <= encoder_channels; ++channel) {
    EXPECT_EQ(again.encoder(channel), turns_of(channel) + part_of(channel));
    EXPECT_EQ(again.encoder_index(channel), turns_of(channel));
    EXPECT_EQ(again.encoder_hz(channel), 0);
  }
  for (int channel = 1; channel <= ultrasonic_channels; ++channel) {
    EXPECT_EQ(again.distance_cm(channel), 50 * channel);
  }
  for (int channel = 1; channel <= encoder_channels; ++channel) {
    board.command(fmt::format("Z:{}", channel));
    const State zeroed = board.next_state();
    EXPECT_EQ(zeroed.encoder(channel), 0);
    EXPECT_EQ(zeroed.encoder_index(channel), -part_of(channel));
  }
}

// Each motor turns one encoder, at a different speed.
void expect_speeds(const ControlledBoard& board) {
  board.command("R:1,On");  // switches the supply of the motors on
  for (int channel = 1; channel <= osmc_channels; ++channel) {
    board.command(fmt::format("O:{},{},{}", 1000 * channel, channel % 2, channel));
  }
  await(board, [](const State& s) {
    for (int channel = 1; channel <= encoder_channels; ++channel) {
      const int speed = 1000 * channel * sim::MotorModel::top_speed / pwm_max;
      const int hz = channel % 2 == 0 ? -s.encoder_hz(channel) : s.encoder_hz(channel);
      if (hz < speed - speed / 8 || hz > speed + speed / 8) return false;
    }
    return true;
  });
}

void expect_drives(const ControlledBoard& board) {
  for (int channel = 1; channel <= osmc_channels; ++channel) {
    const std::uint16_t pwm = static_cast<std::uint16_t>(1000 + channel);
    for (const Direction direction : {Direction::forward, Direction::reverse}) {
      board.command(fmt::format("O:{},{},{}", pwm, static_cast<int>(direction), channel));
      board.command(fmt::format("D:{},{},{}", pwm + 10, static_cast<int>(direction), channel));
      const State state = board.next_state();
      const sim::Pins pins = pins_of(board);
      const Drive osmc{pwm, direction};
      const Drive dhb12{static_cast<std::uint16_t>(pwm + 10), direction};
      EXPECT_EQ(pins.osmc[channel - 1], osmc) << channel;
      EXPECT_EQ(state.osmc(channel), osmc) << channel;
      EXPECT_EQ(pins.dhb12[channel - 1], dhb12) << channel;
      EXPECT_EQ(state.dhb12(channel), dhb12) << channel;
    }
  }
}

void expect_servos_and_relays(const ControlledBoard& board) {
  for (int channel = 1; channel <= servo_channels; ++channel) {
    const int us = 700 + 100 * channel;
    board.command(fmt::format("S:{},{}", us, channel));
    EXPECT_EQ(board.next_state().servo_us(channel), us);
    EXPECT_NEAR(pins_of(board).servo_us[channel - 1], us, 3) << channel;
  }
  unsigned on = 0;
  for (int channel = 1; channel <= relay_channels; ++channel) {
    board.command(fmt::format("R:{},On", channel));
    on |= 1U << (channel - 1);
    EXPECT_EQ(board.next_state().relays, on);
    EXPECT_EQ(pins_of(board).relays, on);
  }
  board.command("R:3,Off");
  EXPECT_EQ(pins_of(board).relays, on & ~0b100U);
}

void expect_brushless(const ControlledBoard& board) {
  for (int channel = 1; channel <= bldc_channels; ++channel) {
    for (const bool brake : {false, true}) {
      const Bldc bldc{static_cast<std::uint16_t>(2000 + channel),
                      channel % 2 == 0 ? Direction::reverse : Direction::forward, brake};
      board.command(fmt::format("B:{},{},{},{}", bldc.speed, static_cast<int>(bldc.direction),
                                brake ? 1 : 0, channel));
      EXPECT_EQ(board.next_state().bldc(channel), bldc) << channel;
      EXPECT_EQ(pins_of(board).bldc[channel - 1], bldc) << channel;
    }
  }
}

void expect_steppers(const ControlledBoard& board) {
  for (int channel = 1; channel <= stepper_channels; ++channel) {
    const int to = channel % 2 == 0 ? -50 * channel : 50 * channel;
    board.command(fmt::format("P:{},5000,{}", to, channel));
    await(board, [&](const State& s) { return s.steps(channel) == to; });
    EXPECT_EQ(pins_of(board).stepper[channel - 1].position, to) << channel;
  }
}

void drive(const ControlledBoard& board) {
  board.command("R:1,On");
  board.command("O:500,1,1");
  EXPECT_EQ(pins_of(board).osmc[0].pwm, 500);
  EXPECT_EQ(pins_of(board).relays, 1);
  EXPECT_EQ(board.next_state().relays, 1);
}

// Every output is off, and stays off until the next command.
void expect_that_nothing_came_back(const ControlledBoard& board) {
  const State state = board.next_state();
  EXPECT_EQ(state.relays, 0);
  EXPECT_EQ(state.osmc(1).pwm, 0);
  EXPECT_TRUE(pins_of(board).is_safe());
}

void expect_interlocks(const ControlledBoard& board) {
  for (int channel = 1; channel <= ultrasonic_channels; ++channel) {
    drive(board);
    board.command(fmt::format("U:{},{}", 50 * channel + 1, channel));
    await(board, [](const State& s) { return s.safe == SafeReason::proximity; });
    EXPECT_TRUE(pins_of(board).is_safe()) << channel;
    board.command(fmt::format("U:0,{}", channel));
    await(board, [](const State& s) { return s.safe == SafeReason::none; });
    expect_that_nothing_came_back(board);
  }
  drive(board);
  board.at_board([](sim::SimulatedBoard& at) { at.model().hold_handle(false); });
  await(board, [](const State& s) { return s.safe == SafeReason::handle && !s.handle_held(); });
  EXPECT_TRUE(pins_of(board).is_safe());
  board.at_board([](sim::SimulatedBoard& at) { at.model().hold_handle(true); });
  await(board, [](const State& s) { return s.safe == SafeReason::none && s.handle_held(); });
  expect_that_nothing_came_back(board);
  drive(board);
}

}  // namespace

ControlledBoard controlled(BoardInAThread& simulated, Board& host) {
  return {
      [&host](const std::string& command) { host.send(command, channel_patience); },
      [&host] {
        host.next_state(channel_patience);  // this state may have been sent before the call
        return host.next_state(channel_patience);
      },
      [&simulated](const auto& action) { simulated.run(action); },
  };
}

void expect_every_channel(const ControlledBoard& board) {
  board.command("F:ALL");
  expect_inputs(board);
  expect_speeds(board);
  expect_drives(board);
  expect_servos_and_relays(board);
  expect_brushless(board);
  expect_steppers(board);
  board.command("E:STOP");
  await(board, [](const State& s) { return s.safe == SafeReason::stop; });
  // The pulses of the steppers have ended. The model detects their end after a pause.
  const State stopped = board.next_state();
  await(board, [&](const State& s) {
    return s.t_ms - stopped.t_ms > sim::BoardModel::stepper_pause_ms + 20;
  });
  EXPECT_TRUE(pins_of(board).is_safe());
  board.command("E:CLEAR");
  await(board, [](const State& s) { return s.safe == SafeReason::none; });
  EXPECT_TRUE(pins_of(board).is_safe());
  expect_interlocks(board);
}

}  // namespace r4::test
