// SPDX-License-Identifier: GPL-3.0-or-later
// Boards with any wiring, and boards with an unknown wiring.
#include <algorithm>

#include "bench.hpp"
#include "tests/giga/core/registers.hpp"
#include "tests/support/random_wiring.hpp"

namespace r4::test {
namespace {

class AnyWiring : public testing::TestWithParam<int> {
 protected:
  AnyWiring() {
    for (const SignalKind kind : {SignalKind::encoder_a, SignalKind::encoder_b,
                                  SignalKind::encoder_index, SignalKind::echo}) {
      for (int i = 1; i <= 4; ++i) set(kind, i, false);
    }
    bench_.boot();
    bench_.run_ms(150, host_, bench_.usb());
  }
  Place place(SignalKind kind, int channel) const { return wiring_.at(kind, channel); }
  bool has(SignalKind kind, int channel) const { return place(kind, channel).connected(); }
  void set(SignalKind kind, int channel, bool high) {
    if (!has(kind, channel)) return;
    const giga::Pin pin = giga::pin_of(place(kind, channel));
    bench_.giga.set_pin(pin.port, pin.number, high);
  }
  bool is_high(SignalKind kind, int channel) {
    const giga::Pin pin = giga::pin_of(place(kind, channel));
    return bench_.giga.pin(pin.port, pin.number);
  }
  void command(const std::string& field) { bench_.usb()(host_.command(field)); }
  void run_ms(std::uint64_t ms) { bench_.run_ms(ms, host_, bench_.usb()); }
  // The newest state with these fields.
  State state(const std::string& fields) {
    command("F:" + fields);
    run_ms(30);
    bench_.usb_lines();
    run_ms(30);
    State state;
    for (const std::string& line : bench_.usb_lines()) {
      Datagram datagram;
      if (read_datagram(line, datagram)) read_state(datagram, state);
    }
    return state;
  }

  const Wiring wiring_ = random_wiring(static_cast<std::uint64_t>(GetParam()));
  GigaBench bench_{wiring_};
  PlainHost host_;
};
INSTANTIATE_TEST_SUITE_P(Seeds, AnyWiring, testing::Range(1, 31));

TEST_P(AnyWiring, TheChipsAreDrivenWhereTheyAre) {
  ASSERT_EQ(bench_.reason(), SafeReason::none);
  const bool osmc =
      has(SignalKind::osmc_pwm, 1) &&
      wiring_
          .chip(place(SignalKind::osmc_pwm, 1).number() < pca9685_lines ? Chip::osmc_pwm
                                                                        : Chip::dhb12_pwm)
          .connected();
  const bool relay = has(SignalKind::relay, 3) && wiring_.chip(Chip::expander).connected();
  command("O:358,1,1");
  command("R:3,On");
  run_ms(20);
  EXPECT_EQ(bench_.pins().osmc[0], osmc ? (Drive{358, Direction::forward}) : Drive());
  EXPECT_EQ(bench_.pins().relays, relay ? 0b100 : 0);
  bench_.usb()(with_crc("E:STOP;"));
  run_ms(5);
  EXPECT_EQ(bench_.pins().osmc[0].pwm, 0);
  EXPECT_EQ(bench_.pins().relays, 0);
}

TEST_P(AnyWiring, TheSteppersStepAtTheirPins) {
  for (int i = 1; i <= stepper_channels; ++i) command("P:20,2000," + std::to_string(i));
  run_ms(40);
  for (int i = 1; i <= stepper_channels; ++i) {
    if (!has(SignalKind::step, i)) continue;
    const giga::Pin step = giga::pin_of(place(SignalKind::step, i));
    EXPECT_EQ(bench_.giga.rises(step.port, step.number), 20) << i;
    const bool low_is_forward = place(SignalKind::step_direction, i).option();
    EXPECT_NE(is_high(SignalKind::step_direction, i), low_is_forward) << i;
  }
}

TEST_P(AnyWiring, TheEncodersCountTheirLines) {
  for (int i = 1; i <= encoder_channels; ++i) {
    for (int edge = 0; edge < 4 * i; ++edge) {
      const SignalKind line = edge % 2 == 0 ? SignalKind::encoder_a : SignalKind::encoder_b;
      set(line, i, edge % 4 < 2);
    }
    set(SignalKind::encoder_index, i, true);
  }
  const State now = state("ENC1,ENC2,ENC3,ENC4,ENC1IDX,ENC2IDX,ENC3IDX,ENC4IDX");
  for (int i = 1; i <= encoder_channels; ++i) {
    const int counts = has(SignalKind::encoder_a, i) ? 4 * i : 0;
    EXPECT_EQ(now.encoder(i), counts);
    EXPECT_EQ(now.encoder_index(i), has(SignalKind::encoder_index, i) ? counts : 0);
  }
}

TEST_P(AnyWiring, TheAnalogInputsAndTheHandleAreRead) {
  for (int i = 1; i <= analog_channels; ++i) {
    if (!has(SignalKind::analog, i)) continue;
    const giga::Pin pin = giga::pin_of(place(SignalKind::analog, i));
    bench_.giga.analog[(pin.port - 'A') << 4 | pin.number] =
        static_cast<unsigned short>(0x1000 * i);
  }
  const State now = state("AIN24,AIN12,AIN5,AINDMH,AINSTEER,AIN6,DMHSTA");
  for (int i = 0; i < analog_channels; ++i) {
    const int volts_cv = has(SignalKind::analog, i + 1) ? 5000 * 0x1000 * (i + 1) / 0xFFFF : 0;
    EXPECT_NEAR(now.raw.analog_cv[i], volts_cv, 1) << i;
  }
  EXPECT_TRUE(now.handle_held());
  bench_.hold_handle(false);
  run_ms(20);
  EXPECT_EQ(bench_.reason(), has(SignalKind::handle, 1) ? SafeReason::handle : SafeReason::none);
}

TEST_P(AnyWiring, AnEchoBelongsToTheTriggeredSensor) {
  for (int i = 1; i <= ultrasonic_channels; ++i) {
    if (!has(SignalKind::trigger, i)) continue;
    bool answered = false;
    for (int turns = 0; turns < 600 && !answered; ++turns) {
      bench_.turn();
      if (!is_high(SignalKind::trigger, i)) continue;
      while (is_high(SignalKind::trigger, i)) bench_.turn();
      set(SignalKind::echo, i, true);
      bench_.giga.pass_us(100 * 58);
      set(SignalKind::echo, i, false);
      answered = true;
    }
    EXPECT_TRUE(answered) << i;
    run_ms(50);
    const State now = state("US1,US2,US3,US4");
    EXPECT_EQ(now.distance_cm(i), 100);
  }
}

TEST(GigaWiring, WithoutAnalogInputsTheConverterRestsAndAllRead0) {
  Wiring wiring = plan_wiring();
  for (int i = 1; i <= analog_channels; ++i) wiring.at(SignalKind::analog, i) = {};
  GigaBench bench(wiring);
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.usb());
  EXPECT_TRUE(has_line(bench.usb_lines(), "AIN24:0.00;"));
  EXPECT_EQ(static_cast<std::uint32_t>(ADC1->CR), 0U);
}

// --- an unknown wiring

TEST(GigaWiringFault, ANewBoardWaitsForItsOwner) {
  GigaBench bench;
  bench.giga.stored.clear();
  bench.boot();
  PlainHost host;
  bench.run_ms(150, host, bench.usb());
  EXPECT_EQ(bench.reason(), SafeReason::fault);
  bench.usb()(host.command("O:358,1,1"));
  bench.run_ms(20);
  EXPECT_TRUE(bench.pins().is_safe());
  EXPECT_TRUE(has_line(bench.usb_lines(), "FAULT:0,6;"));
  EXPECT_TRUE(has_line(bench.report(), "Wiring: the plan, which nobody has confirmed"));
  bench.run_ms(1100, host, bench.usb());
  bench.usb()(host.command("E:CLEAR"));
  bench.drive(host, bench.usb());

  char value[max_wiring_value];
  bench.usb()(host.command("C:wiring," + str(write_wiring_value(plan_wiring(), value))));
  bench.run_ms(20);
  ASSERT_TRUE(bench.run_until([&] {
    const std::lock_guard<std::mutex> lock(bench.giga.mutex);
    return bench.giga.writes == 1;
  }));
  bench.restart();
  PlainHost again;
  bench.drive(again, bench.usb());
  EXPECT_TRUE(has_line(bench.report(), "Wiring: given by its owner"));
}

// The board must connect nothing, and stay safe.
void expect_lost(GigaBench& bench) {
  const std::size_t before = bench.giga.i2c.log.size();
  bench.boot();
  PlainHost host;
  bench.run_ms(150, host, bench.usb());
  EXPECT_EQ(bench.reason(), SafeReason::fault);
  EXPECT_TRUE(has_line(bench.usb_lines(), "FAULT:0,7;"));
  EXPECT_TRUE(has_line(bench.report(), "Wiring: damaged"));
  bench.run_ms(1100, host, bench.usb());
  bench.usb()(host.command("E:CLEAR"));
  bench.usb()(host.command("O:358,1,1"));
  bench.usb()(host.command("P:20,1000,1"));
  bench.run_ms(100, host, bench.usb());
  EXPECT_EQ(bench.reason(), SafeReason::fault);
  sim::ChipPins outputs = bench.pins();
  for (Bldc& channel : outputs.bldc) channel.brake = true;  // their lines are unknown
  EXPECT_TRUE(outputs.is_safe());
  const giga::Pin step = giga::pin_of(plan_wiring().at(SignalKind::step));
  EXPECT_NE(r4_fake_gpio[step.port - 'A'].MODER.value >> (2 * step.number) & 3U, 1U)
      << "not an output";
  for (std::size_t i = before; i < bench.giga.i2c.log.size(); ++i) {
    const int address = bench.giga.i2c.log[i][0] >> 1;
    EXPECT_TRUE(address == 0 || address == 0x70 || bench.giga.i2c.log[i].size() == 1)
        << "only the outputs of all PCA9685 are switched off, and the report asks";
  }
}

TEST(GigaWiringFault, ADamagedWiringConnectsNothing) {
  GigaBench bench;
  bench.giga.stored["r4-settings"][20] ^= 1;
  expect_lost(bench);
}

TEST(GigaWiringFault, AStoreThatCannotBeReadConnectsNothing) {
  GigaBench bench;
  bench.giga.flash_damaged = true;
  expect_lost(bench);
  EXPECT_TRUE(has_line(bench.report(), "CAN: 1000 kbit/s, node 1, off")) << "its number is unknown";
}

TEST(GigaWiringFault, AStoreThatHangsConnectsNothing) {
  GigaBench bench;
  bench.giga.flash_hangs = true;
  expect_lost(bench);
  EXPECT_TRUE(has_line(bench.report(), "CAN: 1000 kbit/s, node 1, off")) << "its number is unknown";
  bench.giga.flash_hangs = false;
}

Wiring at_the_second_bus() {
  Wiring wiring = plan_wiring();
  wiring.at(SignalKind::chip_bus).byte = 1;
  return wiring;
}

TEST(GigaBuses, TheChipsMayBeAtTheSecondBusAndTheUsersDevicesAtTheFirst) {
  GigaBench bench(at_the_second_bus());
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.usb());
  bench.usb()(host.command("X:SCAN"));
  bench.run_ms(300, host, bench.usb());
  EXPECT_TRUE(has_line(bench.usb_lines(), ",x4068;")) << "INA219 and MPU-6050";
  EXPECT_EQ(bench.reason(), SafeReason::none);
}

// The firmware has the wiring of the plan, but the chips are on the other bus and their outputs are
// on.
TEST(GigaBuses, ChipsAtTheOtherBusAreSwitchedOffThereAndTransfersAreRefused) {
  GigaBench bench(at_the_second_bus());
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.usb());
  bench.usb()(host.command("R:1,On"));
  bench.run_ms(20);
  bench.store("", plan_wiring());
  bench.giga.user_i2c.log.clear();
  bench.restart();
  EXPECT_TRUE(bench.pins().is_safe()) << "relays and brakes, too";
  PlainHost again;
  bench.run_ms(150, again, bench.usb());
  EXPECT_EQ(bench.reason(), SafeReason::fault);
  EXPECT_TRUE(has_line(bench.usb_lines(), "FAULT:0,8;"));
  bench.run_ms(1100, again, bench.usb());
  for (const char* field :
       {"E:CLEAR", "O:358,1,1", "X:READ,0x40,x00,1", "X:SCAN", "X:POLL,0x40,x00,1,10,1"}) {
    bench.usb()(again.command(field));
  }
  bench.run_ms(50);
  EXPECT_EQ(bench.reason(), SafeReason::fault);
  EXPECT_TRUE(bench.pins().is_safe());
  const std::vector<std::string> lines = bench.usb_lines();
  EXPECT_EQ(std::count_if(lines.begin(), lines.end(),
                          [](const std::string& line) {
                            return line.find(",UNKNOWN;") != std::string::npos;
                          }),
            3);
  ASSERT_EQ(bench.giga.user_i2c.log.size(), 1U) << "the users' devices were only asked";
  EXPECT_EQ(bench.giga.user_i2c.log[0][0], 0x70 << 1 | 1);
}

TEST(GigaWiringFault, TheOutputsLeftOnAreSwitchedOffBeforeTheWiringIsKnown) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.usb());
  bench.giga.flash_hangs = true;
  bench.giga.at(bench.giga.now_ns() + 20000000, [&] { EXPECT_EQ(bench.pins().osmc[0].pwm, 0); });
  bench.restart();
  EXPECT_TRUE(bench.pins().is_safe());
  bench.giga.flash_hangs = false;
}

}  // namespace
}  // namespace r4::test
