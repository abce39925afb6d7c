// SPDX-License-Identifier: GPL-3.0-or-later
// The outputs are safe despite interrupts, failing chips and a held bus.
#include <gtest/gtest.h>

#include <algorithm>

#include "board_bench.hpp"
#include "firmware/board_hardware.hpp"

namespace r4::firmware {
namespace {

using Bench = test::BoardBench;
using test::full;

TEST(BoardHardware, CanBeMadeSafeDuringEveryTransfer) {
  // make_safe() runs in an interrupt at every transfer of set-up, apply and verification. The
  // transfer is cut short, or it completes afterwards with old values.
  for (const bool cuts : {true, false}) {
    for (int at = 0; at < 60; ++at) {
      Bench bench;
      bench.line.cuts = cuts;
      bench.line.what = [&] { bench.hardware.make_safe(); };
      bench.line.after = at;
      bench.hardware.power_up(bench.now());
      int polls = 0;
      while (bench.line.after >= 0 && polls++ < 200) {
        bench.run(1);
        if (bench.line.after < 0) break;
        Outputs outputs = full();
        outputs.osmc[0].pwm = static_cast<std::uint16_t>(polls);
        if (bench.hardware.ready()) bench.hardware.apply(outputs);
      }
      EXPECT_LT(bench.line.after, 0);
      EXPECT_TRUE(bench.board.pins().is_safe()) << "transfer " << at << (cuts ? " cut" : " stale");
    }
  }
}

TEST(BoardHardware, ATransferCutShortByTheSafeStateIsNotAChipFault) {
  for (int at = 0; at < 60; ++at) {
    Bench bench;
    bench.boot();
    bench.line.what = [&] { bench.hardware.make_safe(); };
    bench.line.after = at;
    Outputs outputs = full();
    for (int i = 0; bench.line.after >= 0; ++i) {
      outputs.osmc[0].pwm = static_cast<std::uint16_t>(i);
      bench.hardware.apply(outputs);
      bench.run(1);
    }
    EXPECT_FALSE(bench.hardware.fault().any()) << "transfer " << at;
    bench.run(150);
    EXPECT_FALSE(bench.hardware.fault().any()) << "transfer " << at;
    EXPECT_TRUE(bench.hardware.ready());
    bench.apply(full());
    EXPECT_EQ(test::outputs_of(bench.board), test::as_pins(full()));
  }
}

TEST(BoardHardware, ABusHeldWhenTheSafeStateCutsATransferIsAFault) {
  Bench bench;
  bench.boot();
  bench.line.what = [&] {
    bench.board.bus.hold(1000);
    bench.hardware.make_safe();
  };
  bench.line.after = 0;
  bench.hardware.apply(full());
  EXPECT_EQ(bench.hardware.fault().trouble, ChipTrouble::bus_stuck);
}

TEST(BoardHardware, AFaultHandlerThatNeverReturnsLeavesEverythingSafe) {
  struct Halt {};
  for (int at = 0; at < 12; ++at) {
    Bench bench;
    bench.boot();
    bench.apply(full());
    Outputs outputs = full();
    for (int i = 0; i < 4; ++i) outputs.dhb12[i].pwm = 77;
    for (std::uint16_t& us : outputs.servo_us) us = 999;
    bench.line.after = at;
    bench.line.what = [&] {
      bench.hardware.make_safe();
      throw Halt();
    };
    try {
      bench.hardware.apply(outputs);
      bench.run(200);
      FAIL() << "no transfer " << at;
    } catch (const Halt&) {
      EXPECT_TRUE(bench.board.pins().is_safe()) << at;
    }
  }
}

TEST(BoardHardware, MayBeMadeSafeWhileItIsBeingMadeSafe) {
  for (int at = 0; at < 7; ++at) {
    Bench bench;
    bench.boot();
    bench.apply(full());
    bench.line.after = at;
    bench.line.what = [&] {
      bench.hardware.make_safe();
      EXPECT_EQ(bench.line.recoveries, 1) << at;  // the bus was in use
    };
    bench.hardware.make_safe();
    EXPECT_TRUE(bench.board.pins().is_safe()) << at;
    EXPECT_FALSE(bench.hardware.fault().any())
        << "a transfer that was cut short is not a fault: transfer " << at;
    bench.run(150);
    EXPECT_TRUE(bench.hardware.ready() && !bench.hardware.fault().any()) << at;
  }
}

// A host may repeat its stop: the second interrupt occurs in the middle of the first make_safe().
TEST(BoardHardware, MayBeMadeSafeAgainWhileAnInterruptMakesItSafe) {
  for (int at = 0; at < 7; ++at) {
    for (int again = 0; again < 14; ++again) {
      Bench bench;
      bench.boot();
      bench.apply(full());
      int times = 0;
      bench.line.after = at;
      bench.line.what = [&] {
        if (++times == 1) bench.line.after = again;
        bench.hardware.make_safe();
      };
      bench.hardware.make_safe();
      EXPECT_EQ(times, 2) << at << ' ' << again;
      EXPECT_TRUE(bench.board.pins().is_safe()) << at << ' ' << again;
      EXPECT_FALSE(bench.hardware.fault().any()) << at << ' ' << again;
      bench.run(150);
      EXPECT_TRUE(bench.hardware.ready() && !bench.hardware.fault().any()) << at << ' ' << again;
    }
  }
}

struct ChipAt {
  Chip chip;
  std::uint8_t address;
};
constexpr ChipAt chips_at[] = {{Chip::osmc_pwm, 0x40},
                               {Chip::dhb12_pwm, 0x41},
                               {Chip::servo_pwm, 0x42},
                               {Chip::expander, 0x20},
                               {Chip::dac, 0x61}};

std::uint8_t address_of(Chip chip) { return plan_wiring().chip(chip).number(); }

TEST(BoardHardware, ASilentChipIsReportedByNameAndAllOutputsGoSafe) {
  for (const ChipAt& at : chips_at) {
    Bench bench;
    bench.boot();
    bench.apply(full());
    bench.board.bus.refuse(at.address, 0, 1000);
    bench.run(110);
    EXPECT_EQ(bench.hardware.fault().address, address_of(at.chip));
    EXPECT_EQ(bench.hardware.fault().trouble, ChipTrouble::no_acknowledge);
    const Outputs pins = test::outputs_of(bench.board);
    EXPECT_EQ(pins.bldc[0].speed, at.chip == Chip::dac ? 3000 : 0);
    EXPECT_EQ(pins.bldc[0].brake, at.chip != Chip::expander);
    EXPECT_EQ(pins.relays, at.chip == Chip::expander ? 0xFF : 0);
    EXPECT_EQ(pins.osmc[0].pwm, 0);  // all-call reaches a chip that is silent at its own address
    EXPECT_FALSE(bench.hardware.clear_fault());
    bench.apply(full());
    EXPECT_EQ(test::outputs_of(bench.board).dhb12[1].pwm, 0);
  }
}

TEST(BoardHardware, OutputsStayOffAfterAChipFaultUntilItIsCleared) {
  for (const ChipAt& at : chips_at) {
    Bench bench;
    bench.boot();
    bench.apply(full());
    bench.board.bus.refuse(at.address, 0, 3);
    bench.run(400);
    EXPECT_TRUE(bench.hardware.ready()) << chip_name(address_of(at.chip));
    EXPECT_EQ(bench.hardware.fault().address, address_of(at.chip));
    EXPECT_TRUE(bench.board.pins().is_safe());
    bench.apply(full());
    EXPECT_TRUE(bench.board.pins().is_safe());
    EXPECT_TRUE(bench.hardware.clear_fault());
    EXPECT_TRUE(bench.board.pins().is_safe());
    bench.apply(full());
    EXPECT_EQ(test::outputs_of(bench.board), test::as_pins(full()));
  }
}

TEST(BoardHardware, NoticesAChipResetWithinOneVerificationCycle) {
  for (const ChipAt& at : chips_at) {
    Bench bench;
    bench.boot();
    bench.apply(full());
    bench.board[at.chip].power_on();
    bench.run(chip_count * 20 + 2);
    EXPECT_EQ(bench.hardware.fault().address, address_of(at.chip));
    EXPECT_EQ(bench.hardware.fault().trouble, ChipTrouble::was_reset)
        << chip_name(address_of(at.chip));
    EXPECT_TRUE(bench.board.pins().is_safe());
    bench.run(200);
    EXPECT_TRUE(bench.hardware.clear_fault());
  }
}

TEST(BoardHardware, AChipResetAtAnyByteIsNoticedOrHarmless) {
  for (std::size_t after = 1; after < 120; after += 3) {
    for (const ChipAt& at : chips_at) {
      Bench bench;
      bench.boot();
      bench.board.bus.reset_after(bench.board[at.chip], after);
      bench.apply(full(), 240);
      if (bench.hardware.fault().any()) {
        EXPECT_TRUE(bench.board.pins().is_safe());
      } else {
        EXPECT_EQ(test::outputs_of(bench.board), test::as_pins(full())) << after;
      }
    }
  }
}

// The effect of a disturbance on the modes of a PWM chip: INVRT, EXTCLK, or both.
constexpr std::uint8_t inverted_outputs = 0x10;
constexpr std::uint8_t external_clock = 0x40;
struct Disturbance {
  std::uint8_t mode1;
  std::uint8_t mode2;
};
constexpr Disturbance disturbances[] = {
    {0, inverted_outputs}, {external_clock, 0}, {external_clock, inverted_outputs}};

void disturb_chip(Bench& bench, int chip, const Disturbance& by) {
  sim::Pca9685Model* const chips[] = {&bench.board.osmc, &bench.board.dhb12, &bench.board.servo};
  chips[chip]->disturb(0x00, by.mode1);
  chips[chip]->disturb(0x01, by.mode2);
}

TEST(BoardFaults, ResetsAndReportsAChipWithDisturbedModes) {
  for (const Disturbance& by : disturbances) {
    for (int chip = 0; chip < 3; ++chip) {
      Bench bench;
      bench.boot();
      bench.apply(full());
      disturb_chip(bench, chip, by);
      bench.run(chip_count * 20 + 2);
      EXPECT_TRUE(bench.board.pins().is_safe()) << chip;
      EXPECT_EQ(bench.hardware.fault().trouble, ChipTrouble::wrong_register) << chip;
      EXPECT_EQ(bench.hardware.fault().address, 0x40 + chip);
      bench.run(200);
      EXPECT_TRUE(bench.board.pins().is_safe()) << chip;
      EXPECT_TRUE(bench.hardware.clear_fault()) << chip;
      bench.apply(full());
      EXPECT_EQ(test::outputs_of(bench.board), test::as_pins(full())) << chip;
    }
  }
}

TEST(BoardFaults, ReportsAChipWithADisturbedFrequency) {
  for (int chip = 0; chip < 3; ++chip) {
    Bench bench;
    bench.boot();
    bench.apply(full());
    sim::Pca9685Model* const chips[] = {&bench.board.osmc, &bench.board.dhb12, &bench.board.servo};
    chips[chip]->disturb(0xFE, 0x10);
    bench.run(chip_count * 20 + 2);
    EXPECT_TRUE(bench.board.pins().is_safe()) << chip;
    EXPECT_EQ(bench.hardware.fault().trouble, ChipTrouble::wrong_register) << chip;
    EXPECT_EQ(bench.hardware.fault().address, 0x40 + chip);
  }
}

// docs/reference/safety.md, "How long it takes". Each check reads one of the 16 outputs.
TEST(BoardFaults, NoticesADisturbedOutputWithin16ChecksAlsoInTheSafeState) {
  constexpr std::uint8_t full = 0x10;
  int longest_ms = 0;
  for (int chip = 0; chip < 3; ++chip) {
    for (int channel = 0; channel < 16; channel += 2) {
      Bench bench;
      bench.boot();
      bench.hardware.make_safe();
      bench.run(20);
      sim::Pca9685Model* const chips[] = {&bench.board.osmc, &bench.board.dhb12,
                                          &bench.board.servo};
      const int first = 0x06 + 4 * channel;
      chips[chip]->disturb(static_cast<std::uint8_t>(first + 1), full);  // always on
      chips[chip]->disturb(static_cast<std::uint8_t>(first + 3), full);  // not always off
      ASSERT_TRUE(chips[chip]->high(channel));
      int ms = 0;
      for (; chips[chip]->duty(channel) != 0 && ms < 2000; ++ms) bench.run(1);
      longest_ms = std::max(longest_ms, ms);
      EXPECT_EQ(bench.hardware.fault().trouble, ChipTrouble::wrong_register) << chip;
      EXPECT_EQ(bench.hardware.fault().address, 0x40 + chip);
      EXPECT_TRUE(bench.board.pins().is_safe()) << chip << ' ' << channel;
    }
  }
  EXPECT_LE(longest_ms, 1602);
}

TEST(BoardFaults, TheSafeStateAlsoTurnsOffAChipWithDisturbedModes) {
  for (const Disturbance& by : disturbances) {
    for (int chip = 0; chip < 3; ++chip) {
      Bench bench;
      bench.boot();
      bench.apply(full());
      disturb_chip(bench, chip, by);
      bench.hardware.make_safe();
      bench.run(4);
      EXPECT_TRUE(bench.board.pins().is_safe()) << chip;
    }
  }
}

TEST(BoardFaults, PowerUpResetsChipsWithDisturbedModes) {
  for (const Disturbance& by : disturbances) {
    Bench bench;
    bench.boot();
    bench.apply(full());
    for (int chip = 0; chip < 3; ++chip) disturb_chip(bench, chip, by);
    BoardHardware next(bench.board.bus, bench.board.microcontroller_pins(), {});
    next.power_up(bench.now());
    for (int ms = 0; ms < 20; ++ms) {
      EXPECT_TRUE(bench.board.pins().is_safe());
      bench.board.bus.advance(1000);
      next.poll(bench.now());
    }
    EXPECT_TRUE(next.ready());
    EXPECT_FALSE(next.fault().any());
  }
}

TEST(BoardFaults, ResetsAChipAgainIfItMissedItsReset) {
  Bench bench;
  bench.boot();
  bench.apply(full());
  disturb_chip(bench, 0, disturbances[2]);
  bench.board.bus.refuse(0x00, 0, 1);
  bench.run(250);
  EXPECT_TRUE(bench.board.pins().is_safe());
  EXPECT_TRUE(bench.hardware.clear_fault());
}

TEST(BoardHardware, AHeldBusIsFreedAndEverythingIsSafeAtOnce) {
  for (std::size_t after = 1; after < 60; ++after) {
    Bench bench;
    bench.boot();
    bench.board.bus.hold_after(after);
    bench.hardware.apply(full());
    for (int ms = 0; ms < 110 && !bench.hardware.fault().any(); ++ms) bench.run(1);
    EXPECT_EQ(bench.hardware.fault().trouble, ChipTrouble::bus_stuck);
    EXPECT_TRUE(bench.board.pins().is_safe()) << after;
    EXPECT_LE(bench.longest_poll_us, 5000U);
    bench.run(300);
    EXPECT_TRUE(bench.hardware.clear_fault());
    bench.apply(full());
    EXPECT_EQ(test::outputs_of(bench.board), test::as_pins(full()));
  }
}

TEST(BoardHardware, DropsWaitingWritesIfAHeldBusInterruptsTheSafeState) {
  // Most of the applied values are waiting when the bus is held in the middle of make_safe() and
  // cannot be freed. Later the bus is free again.
  for (int polls = 0; polls < 3; ++polls) {
    for (std::size_t after = 1; after <= 33; ++after) {
      Bench bench;
      bench.boot();
      bench.apply(full(), polls);
      bench.board.bus.hold_after(after, 1000);
      bench.hardware.make_safe();
      const bool told = after > 3;  // true: the PWM chips got the first transfer
      bench.board.bus.clear_errors();
      for (int ms = 0; ms < 200; ++ms) {
        bench.run(1);
        if (!told && ms < 100) continue;
        const Outputs pins = test::outputs_of(bench.board);
        EXPECT_EQ(pins.osmc[0].pwm, 0) << after;
        for (const std::uint16_t us : pins.servo_us) EXPECT_EQ(us, 0) << after;
      }
      EXPECT_TRUE(bench.board.pins().is_safe()) << after;
    }
  }
}

TEST(BoardHardware, AHeldBusDelaysTheLoopOnlyBriefly) {
  Bench bench;
  bench.boot();
  bench.apply(full());
  bench.board.bus.hold(1000);
  bench.run(300);
  EXPECT_EQ(bench.hardware.fault().trouble, ChipTrouble::bus_stuck);
  EXPECT_LE(bench.longest_poll_us, 3 * (i2c_timeout_us + 200));
  bench.longest_poll_us = 0;
  bench.run(1000);
  EXPECT_LE(bench.longest_poll_us, 100U);
  const std::uint64_t began = bench.board.bus.now_us();
  bench.hardware.make_safe();
  EXPECT_LE(bench.board.bus.now_us() - began, i2c_timeout_us + 100U);
}

// A chip releases the bus when the bus is recovered, and holds it again whenever the chip is
// addressed.
class HeldByOne final : public I2cBus {
 public:
  HeldByOne(I2cBus& below, std::uint8_t holder) : bus_(below), holder_(holder) {}
  bool holds = false;
  I2cResult write(std::uint8_t address, const std::uint8_t* bytes, std::size_t size) override {
    return addressed(address) ? I2cResult::timeout : bus_.write(address, bytes, size);
  }
  I2cResult write_read(std::uint8_t address, const std::uint8_t* out, std::size_t out_size,
                       std::uint8_t* in, std::size_t in_size) override {
    return addressed(address) ? I2cResult::timeout
                              : bus_.write_read(address, out, out_size, in, in_size);
  }
  bool recover() override {
    held_ = false;
    return bus_.recover();
  }

 private:
  bool addressed(std::uint8_t address) {
    if (holds && address == holder_) held_ = true;
    return held_;
  }
  I2cBus& bus_;
  std::uint8_t holder_;
  bool held_ = false;
};

TEST(BoardFaults, OtherChipsGoSafeIfOneChipHoldsTheBus) {
  for (const Chip chip : {Chip::dac, Chip::expander, Chip::osmc_pwm, Chip::servo_pwm}) {
    test::BoardParts board;
    HeldByOne line(board.bus, address_of(chip));
    BoardHardware hardware(line, board.microcontroller_pins(), {});
    const auto run = [&](int ms) {
      for (int i = 0; i < ms; ++i) {
        hardware.poll(static_cast<std::uint32_t>(board.bus.now_us()));
        board.bus.advance(1000);
      }
    };
    hardware.power_up(0);
    run(20);
    hardware.apply(test::full());
    run(10);
    line.holds = true;
    hardware.make_safe();  // the guard calls make_safe() while the loop hangs
    const sim::ChipPins pins = board.pins();
    const sim::ChipPins safe = sim::ChipPins::safe();
    for (int i = 0; i < 4; ++i) {
      EXPECT_EQ(pins.osmc[i], safe.osmc[i]) << chip_name(address_of(chip));
      EXPECT_EQ(pins.dhb12[i], safe.dhb12[i]) << chip_name(address_of(chip));
      EXPECT_EQ(pins.bldc[i].brake, chip != Chip::expander) << chip_name(address_of(chip));
      EXPECT_EQ(pins.bldc[i].speed == 0, chip != Chip::dac) << chip_name(address_of(chip));
    }
    EXPECT_EQ(pins.relays == 0, chip != Chip::expander) << chip_name(address_of(chip));
    EXPECT_EQ(pins.servo_us[0], 0) << chip_name(address_of(chip));
  }
}

}  // namespace
}  // namespace r4::firmware
