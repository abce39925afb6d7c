// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/wiring/wiring.hpp"

#include <gtest/gtest.h>

#include <set>

#include "protocol/wiring/giga_pins.hpp"

namespace r4 {
namespace {

constexpr int no_signal = WiringCheck::no_signal;

// The plan with `place` for one signal.
Wiring with(SignalKind kind, int channel, std::uint8_t place) {
  Wiring wiring = plan_wiring();
  wiring.at(kind, channel).byte = place;
  return wiring;
}

TEST(Wiring, ThePlanHasNoFault) {
  EXPECT_EQ(check(plan_wiring()).fault, WiringFault::none);
  EXPECT_EQ(plan_wiring().at(SignalKind::handle).number(), 42);
  EXPECT_EQ(plan_wiring().chip(Chip::dac).number(), 0x61);
  EXPECT_EQ(signal_count, 101);
}

TEST(Wiring, ABoardWithNothingConnectedOnlyHasABus) {
  Wiring wiring;
  EXPECT_EQ(check(wiring).fault, WiringFault::none);
  for (int i = 1; i < signal_count; ++i) EXPECT_FALSE(wiring.places[i].connected());
}

TEST(Wiring, EachIndexBelongsToOneSignal) {
  int index = 0;
  for (int kind = 0; kind < signal_kind_count; ++kind) {
    const SignalKind of = static_cast<SignalKind>(kind);
    for (int channel = 1; channel <= row_of(of).channels; ++channel) {
      EXPECT_EQ(signal_index(of, channel), index);
      EXPECT_EQ(signal_kind(index), of);
      ++index;
    }
  }
  EXPECT_EQ(index, signal_count);
}

struct Case {
  const char* what;
  SignalKind kind;
  int channel;
  int place;
  WiringFault fault;
  int other = no_signal;  // the index of the other signal
  int signal = -1;        // the index of the signal with the fault, if it differs from the entry
};
constexpr int option = Place::option_bit;
constexpr int none = Place::nowhere;
using Fault = WiringFault;
using Kind = SignalKind;

constexpr Case cases[] = {
    {"no such bus", Kind::chip_bus, 1, 2, Fault::place},
    {"no bus", Kind::chip_bus, 1, none, Fault::place},
    {"the shared address", Kind::osmc_chip, 1, 0x70, Fault::place},
    {"below a PCA9685", Kind::osmc_chip, 1, 0x3F, Fault::place},
    {"a reserved address", Kind::servo_chip, 1, 0x78, Fault::place},
    {"above an MCP23017", Kind::expander_chip, 1, 0x28, Fault::place},
    {"below an MCP4728", Kind::dac_chip, 1, 0x5F, Fault::place},
    {"two chips", Kind::dhb12_chip, 1, 0x40, Fault::twice, signals::osmc_chip},
    {"an absent chip", Kind::dac_chip, 1, none, Fault::none},
    {"no such pin", Kind::handle, 1, 103, Fault::place},
    {"D7", Kind::handle, 1, 7, Fault::pin_taken},
    {"SDA", Kind::handle, 1, 20, Fault::pin_taken},
    {"SDA1", Kind::handle, 1, 102, Fault::pin_taken},
    {"CAN", Kind::handle, 1, 94, Fault::pin_taken},
    {"WiFi", Kind::handle, 1, 95, Fault::pin_taken},
    {"BOOT0", Kind::handle, 1, 100, Fault::pin_taken},
    {"another signal's pin", Kind::step, 1, 42, Fault::twice, signals::handle},
    {"an analog pin as an input", Kind::gpio, 1, 82, Fault::none},
    {"an analog input's pin", Kind::gpio, 1, 76, Fault::twice, signals::analog},
    {"no converter", Kind::analog, 6, 47, Fault::no_converter},
    {"A7", Kind::analog, 6, 83, Fault::none},
    {"low while held", Kind::handle, 1, 42 | option, Fault::none},
    {"no handle", Kind::handle, 1, none, Fault::none},
    {"an option without a place", Kind::handle, 1, none | option, Fault::option},
    {"a signal without options", Kind::servo, 1, 32 | option, Fault::option},
    {"PH8, WiFi's interrupt line", Kind::encoder_a, 1, 55, Fault::interrupt_line},
    {"PH10, as echo 1", Kind::encoder_a, 1, 64, Fault::interrupt_line, signals::encoder_a,
     signals::echo},
    {"PH8 without interrupts", Kind::encoder_index, 1, 55, Fault::none},
    {"half a stepper", Kind::step_direction, 2, none, Fault::alone, signals::step_direction + 1,
     signals::step + 1},
    {"the other half", Kind::step, 2, none, Fault::alone, signals::step + 1,
     signals::step_direction + 1},
    {"a servo's line for a motor", Kind::osmc_pwm, 1, 40, Fault::place},
    {"a motor's line for a servo", Kind::servo, 1, 12, Fault::place},
    {"another motor's line", Kind::osmc_pwm, 2, 0, Fault::twice, signals::osmc_pwm},
    {"ten lines away", Kind::osmc_pwm, 1, 11, Fault::none},
    {"eleven lines away", Kind::osmc_pwm, 1, 12, Fault::apart, signals::osmc_direction},
    {"on another chip", Kind::osmc_pwm, 1, 24, Fault::apart, signals::osmc_direction},
    {"another motor's output", Kind::bldc_speed, 2, 0, Fault::twice, signals::bldc_speed},
    {"a relay's line", Kind::bldc_brake, 1, 8, Fault::twice, signals::bldc_brake, signals::relay},
    {"no such line", Kind::relay, 1, 16, Fault::place},
};

TEST(Wiring, EachFaultIsFoundWithItsSignals) {
  for (const Case& c : cases) {
    const WiringCheck found = check(with(c.kind, c.channel, static_cast<std::uint8_t>(c.place)));
    EXPECT_EQ(found.fault, c.fault) << c.what;
    if (c.fault == WiringFault::none) continue;
    EXPECT_EQ(found.signal, c.signal < 0 ? signal_index(c.kind, c.channel) : c.signal) << c.what;
    EXPECT_EQ(found.other, c.other) << c.what;
  }
}

TEST(Wiring, AtTheSecondBusTheGigasOwnChipHasAnAddress) {
  Wiring wiring = with(SignalKind::dac_chip, 1, 0x60);
  EXPECT_EQ(check(wiring).fault, WiringFault::none);
  wiring.at(SignalKind::chip_bus).byte = 1;
  EXPECT_EQ(check(wiring).fault, WiringFault::place);
  EXPECT_EQ(check(wiring).signal, signals::dac_chip);
}

TEST(Wiring, ADhb12MayBeOnTheChipOfTheOsmcs) {
  Wiring wiring = with(SignalKind::dhb12_pwm, 1, 8);
  wiring.at(SignalKind::dhb12_direction, 1).byte = 15;
  EXPECT_EQ(check(wiring).fault, WiringFault::none);
}

// Each byte in each place, because a wiring from a stranger may hold any bytes.
TEST(Wiring, AnyBytesAreCheckedWithoutACrash) {
  for (int signal = 0; signal < signal_count; ++signal) {
    for (int byte = 0; byte < 256; ++byte) {
      Wiring wiring = plan_wiring();
      wiring.places[signal].byte = static_cast<std::uint8_t>(byte);
      const WiringCheck found = check(wiring);
      if (wiring == plan_wiring()) {
        EXPECT_EQ(found.fault, WiringFault::none);
      } else if (found.fault != WiringFault::none) {
        EXPECT_LT(found.signal, signal_count);
      }
    }
  }
}

// The pins are in variants/GIGA/variant.cpp of ArduinoCore-mbed, commit 2080938.
TEST(GigaPins, NoTwoHaveTheSamePin) {
  std::set<std::pair<char, int>> pins;
  for (const GigaPin& pin : giga_pins) {
    EXPECT_TRUE(pin.port >= 'A' && pin.port <= 'K' && pin.number < 16);
    EXPECT_TRUE(pins.emplace(pin.port, pin.number).second) << pin.port << int{pin.number};
  }
}

}  // namespace
}  // namespace r4
