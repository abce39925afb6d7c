// SPDX-License-Identifier: GPL-3.0-or-later
// The firmware's hardware on boards with any wiring that the firmware supports, and on boards whose
// wiring differs from the firmware's.
#include <gtest/gtest.h>

#include <cstdint>
#include <random>

#include "firmware/ports/sim/simulated_hardware.hpp"
#include "tests/support/random_wiring.hpp"

namespace r4::sim {
namespace {

using firmware::Inputs;
using firmware::Outputs;

struct WiredBoard {
  WiredBoard(const Wiring& wired, const Wiring& believed)
      : model(1, wired), hardware(model, believed) {
    for (int i = 0; i < Mcp4728Model::channels; ++i) model.chips().dac.set_eeprom(i, {});
    model.power_on();
    hardware.power_up();
  }
  explicit WiredBoard(const Wiring& wiring) : WiredBoard(wiring, wiring) {}

  void run(int ms) {
    for (int i = 0; i < ms; ++i) hardware.pass_millisecond();
  }
  Inputs inputs() {
    Inputs inputs;
    hardware.hal().sample(inputs);
    return inputs;
  }
  bool has(SignalKind kind, int channel) const {
    return model.chips().wiring.at(kind, channel).connected();
  }
  bool fitted(Chip chip) const { return model.chips().wiring.chip(chip).connected(); }
  bool drives(SignalKind pwm, int channel) const {
    const Place place = model.chips().wiring.at(pwm, channel);
    return place.connected() &&
           fitted(place.number() < pca9685_lines ? Chip::osmc_pwm : Chip::dhb12_pwm);
  }

  BoardModel model;
  SimulatedHardware hardware;
};

Outputs any_outputs(std::mt19937_64& random) {
  const auto below = [&random](int end) {
    return std::uniform_int_distribution<int>(0, end - 1)(random);
  };
  const auto direction = [&] { return below(2) == 0 ? Direction::forward : Direction::reverse; };
  const auto pwm = [&] { return static_cast<std::uint16_t>(below(3) == 0 ? 0 : below(4096)); };
  Outputs outputs;
  for (int i = 0; i < 4; ++i) {
    outputs.osmc[i] = {pwm(), direction()};
    outputs.dhb12[i] = {pwm(), direction()};
    outputs.bldc[i] = {pwm(), direction(), below(2) == 0};
  }
  for (std::uint16_t& us : outputs.servo_us) {
    us = static_cast<std::uint16_t>(below(4) == 0 ? 0 : 500 + below(2001));
  }
  outputs.relays = static_cast<std::uint8_t>(below(256));
  return outputs;
}

void expect_drive(const Drive& pin, const Drive& wanted, bool connected) {
  EXPECT_EQ(pin.pwm, connected ? wanted.pwm : 0);
  if (connected && wanted.pwm != 0) {
    EXPECT_EQ(pin.direction, wanted.direction);
  }
}

void expect_outputs(const WiredBoard& board, const Outputs& outputs) {
  const ChipPins pins = board.model.chips().pins();
  const bool expander = board.fitted(Chip::expander);
  for (int i = 0; i < 4; ++i) {
    expect_drive(pins.osmc[i], outputs.osmc[i], board.drives(SignalKind::osmc_pwm, i + 1));
    expect_drive(pins.dhb12[i], outputs.dhb12[i], board.drives(SignalKind::dhb12_pwm, i + 1));
    const Bldc& bldc = outputs.bldc[i];
    const bool speed = board.fitted(Chip::dac) && board.has(SignalKind::bldc_speed, i + 1);
    EXPECT_EQ(pins.bldc[i].speed, speed ? bldc.speed : 0);
    if (expander && board.has(SignalKind::bldc_direction, i + 1)) {
      EXPECT_EQ(pins.bldc[i].direction, bldc.direction);
    }
    if (expander && board.has(SignalKind::bldc_brake, i + 1)) {
      EXPECT_EQ(pins.bldc[i].brake, bldc.brake);
    }
  }
  for (int i = 0; i < servo_channels; ++i) {
    const bool servo = board.fitted(Chip::servo_pwm) && board.has(SignalKind::servo, i + 1);
    EXPECT_NEAR(pins.servo_us[i], servo ? outputs.servo_us[i] : 0, 3);
  }
  for (int i = 0; i < relay_channels; ++i) {
    const bool relay = expander && board.has(SignalKind::relay, i + 1);
    EXPECT_EQ(pins.relays >> i & 1, relay ? outputs.relays >> i & 1 : 0) << i;
  }
}

// No motor is driven, no relay is closed, and every brake that the board can reach is on.
void expect_safe(const WiredBoard& board) {
  Outputs safe;
  expect_outputs(board, safe);
}

void expect_steppers(WiredBoard& board) {
  Outputs outputs;
  for (int i = 0; i < stepper_channels; ++i) {
    outputs.stepper[i] = {i % 2 == 0 ? 10 + i : -10 - i, 20000, true};
  }
  board.hardware.hal().apply(outputs);
  board.run(3);
  const Pins pins = board.model.pins();
  for (int i = 0; i < stepper_channels; ++i) {
    const bool wired = board.has(SignalKind::step, i + 1);
    EXPECT_EQ(pins.stepper[i].position, wired ? outputs.stepper[i].position : 0) << i;
  }
}

void expect_inputs(WiredBoard& board) {
  for (int i = 0; i < analog_channels; ++i) {
    board.model.pin_analog(static_cast<Analog>(i), 100 * (i + 1));
  }
  for (int i = 1; i <= encoder_channels; ++i) board.model.turn_encoder(i, 1000 + 10 * i);
  for (int i = 1; i <= ultrasonic_channels; ++i) {
    board.model.set_ultrasonic(i, static_cast<std::uint16_t>(50 * i));
  }
  for (int i = 1; i <= gpio_channels; ++i) board.model.set_gpio(i, i % 2 == 0);
  board.model.hold_handle(true);
  board.run(500);
  const Inputs inputs = board.inputs();
  for (int i = 0; i < 4; ++i) {
    EXPECT_NEAR(inputs.analog_cv[i], board.has(SignalKind::analog, i + 1) ? 100 * (i + 1) : 0, 1);
    const bool encoder = board.has(SignalKind::encoder_a, i + 1);
    EXPECT_EQ(inputs.encoder_counts[i], encoder ? 1010 + 10 * i : 0) << i;
    const bool index = encoder && board.has(SignalKind::encoder_index, i + 1);
    EXPECT_EQ(inputs.encoder_index_counts[i], index ? 1000 : 0) << i;
    const bool echo = board.has(SignalKind::echo, i + 1);
    EXPECT_EQ(inputs.ultrasonic_cm[i], echo ? 50 * (i + 1) : 0) << i;
    EXPECT_EQ(inputs.ultrasonic_blind >> i & 1, echo ? 0 : 1) << i;
  }
  for (int i = 0; i < gpio_channels; ++i) {
    if (!board.has(SignalKind::gpio, i + 1)) continue;
    EXPECT_EQ(inputs.gpio >> i & 1, i % 2) << i;
  }
  const bool handle = board.has(SignalKind::handle, 1);
  EXPECT_EQ(inputs.handle, handle ? Handle::held : Handle::none);
  board.model.hold_handle(false);
  EXPECT_EQ(board.inputs().handle, handle ? Handle::released : Handle::none);
}

TEST(WiredHardware, EveryChannelWorksWithAThousandRandomWirings) {
  for (std::uint64_t seed = 1; seed <= 1000 && !testing::Test::HasFailure(); ++seed) {
    const testing::ScopedTrace trace(__FILE__, __LINE__, "seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    WiredBoard board(test::random_wiring(seed));
    EXPECT_TRUE(board.hardware.hal().ready());
    expect_safe(board);
    if (seed % 10 == 0) expect_inputs(board);
    for (int i = 0; i < 5; ++i) {
      const Outputs outputs = any_outputs(random);
      board.hardware.hal().apply(outputs);
      board.run(8);
      expect_outputs(board, outputs);
    }
    board.hardware.hal().make_safe();
    expect_safe(board);
    board.run(8);
    expect_safe(board);
    expect_steppers(board);
    EXPECT_FALSE(board.inputs().fault.any());
  }
}

// At each transfer of a change, a motor has its old or its new duty, each with its own direction.
TEST(WiredHardware, AMotorNeverShowsADutyWithTheOldDirectionHoweverItIsWired) {
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    WiredBoard board(test::random_wiring(seed));
    Outputs outputs[2];
    for (int i = 0; i < 4; ++i) {
      outputs[0].osmc[i] = outputs[0].dhb12[i] = {1000, Direction::forward};
      outputs[1].osmc[i] = outputs[1].dhb12[i] = {3000, Direction::reverse};
    }
    struct Watch final : I2cObserver {
      explicit Watch(const BoardChips& watched) : chips(watched) {}
      void on_transfer(const I2cTransfer&) override {
        const ChipPins pins = chips.pins();
        for (int i = 0; i < 4; ++i) {
          for (const Drive& drive : {pins.osmc[i], pins.dhb12[i]}) {
            const Direction right = drive.pwm == 1000 ? Direction::forward : Direction::reverse;
            ok = ok && (drive.pwm == 0 || drive.direction == right);
          }
        }
      }
      const BoardChips& chips;
      bool ok = true;
    } watch(board.model.chips());
    board.hardware.hal().apply(outputs[0]);
    board.run(5);
    board.model.chips().bus.set_observer(&watch);
    for (int i = 0; i < 6; ++i) {
      board.hardware.hal().apply(outputs[(i + 1) % 2]);
      board.run(i);
    }
    EXPECT_TRUE(watch.ok) << "seed " << seed;
    board.model.chips().bus.set_observer(nullptr);
  }
}

TEST(WiredHardware, FirmwareThatBelievesAnotherWiringMovesTheWrongThings) {
  Wiring wired = plan_wiring();
  std::swap(wired.at(SignalKind::osmc_pwm, 1), wired.at(SignalKind::osmc_pwm, 2));
  std::swap(wired.at(SignalKind::osmc_direction, 1), wired.at(SignalKind::osmc_direction, 2));
  std::swap(wired.at(SignalKind::step, 3), wired.at(SignalKind::step, 4));
  std::swap(wired.at(SignalKind::encoder_a, 1), wired.at(SignalKind::encoder_b, 1));
  wired.at(SignalKind::bldc_direction, 1).byte |= Place::option_bit;
  wired.at(SignalKind::handle).byte |= Place::option_bit;
  wired.at(SignalKind::relay, 2).byte |= Place::option_bit;
  std::swap(wired.at(SignalKind::analog, 1), wired.at(SignalKind::analog, 2));
  ASSERT_EQ(check(wired).fault, WiringFault::none);
  WiredBoard board(wired, plan_wiring());
  Outputs outputs;
  outputs.osmc[0] = {1000, Direction::forward};
  outputs.bldc[0] = {2000, Direction::forward, false};
  outputs.stepper[2] = {5, 20000, true};
  board.hardware.hal().apply(outputs);
  board.model.pin_analog(Analog::ain24, 100);
  board.model.pin_analog(Analog::ain12, 200);
  board.model.turn_encoder(1, 12);
  board.run(50);
  const Pins pins = board.model.pins();
  EXPECT_EQ(pins.osmc[0].pwm, 0);
  EXPECT_EQ(pins.osmc[1], (Drive{1000, Direction::forward}));
  EXPECT_EQ(pins.bldc[0].direction, Direction::reverse);
  EXPECT_EQ(pins.stepper[3].position != 0, true);
  EXPECT_EQ(pins.stepper[2].position, 0);
  EXPECT_EQ(pins.relays, 0b10) << "low closes it";
  const Inputs inputs = board.inputs();
  EXPECT_FALSE(inputs.handle_held());
  EXPECT_NEAR(inputs.analog_cv[0], 200, 1);
  EXPECT_EQ(inputs.encoder_counts[0], -12);
}

TEST(WiredHardware, ChipsAtTheOtherBusAreKeptOffThere) {
  Wiring wired = plan_wiring();
  wired.at(SignalKind::chip_bus).byte = 1;
  BoardModel model(1, wired);
  for (int i = 0; i < Mcp4728Model::channels; ++i) model.chips().dac.set_eeprom(i, {});
  model.power_on();
  SimulatedHardware right(model, wired);
  right.power_up();
  Outputs outputs;
  outputs.osmc[0] = {1000, Direction::forward};
  outputs.relays = 1;
  right.hal().apply(outputs);
  ASSERT_FALSE(model.pins().is_safe());
  SimulatedHardware wrong(model, plan_wiring());
  wrong.power_up();
  EXPECT_TRUE(model.pins().is_safe());
  EXPECT_EQ(wrong.hal().fault(), (ChipFault{0, ChipTrouble::other_bus}));
  EXPECT_FALSE(wrong.hal().clear_fault());
  wrong.hal().apply(outputs);
  EXPECT_TRUE(model.pins().is_safe());
  firmware::Application::Config config;
  wrong.add_devices(config);
  EXPECT_EQ(config.i2c, nullptr) << "the user could reach the chips";
}

TEST(WiredHardware, AChipAtAnotherAddressIsSilent) {
  Wiring wired = plan_wiring();
  wired.at(SignalKind::dac_chip).byte = 0x62;
  WiredBoard board(wired, plan_wiring());
  board.run(200);
  EXPECT_EQ(board.inputs().fault, (ChipFault{0x61, ChipTrouble::no_acknowledge}));
}

}  // namespace
}  // namespace r4::sim
