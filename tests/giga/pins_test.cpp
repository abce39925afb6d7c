// SPDX-License-Identifier: GPL-3.0-or-later
// The pins of the firmware on a fake Giga: analog inputs, steppers, encoders, sensors.
#include <algorithm>

#include "bench.hpp"

namespace r4::test {
namespace {

TEST(GigaPins, VoltagesAreConvertedWithoutTheCore) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.run_ms(150, host, bench.usb());
  const int by_core = bench.giga.core_conversions;
  EXPECT_EQ(by_core, analog_channels) << "at the start only";
  bench.giga.analog = {{0x24, 6554},  {0x25, 13108}, {0x10, 19662},
                       {0x11, 26215}, {0x23, 32769}, {0x22, 39322}};
  bench.usb()(host.command("F:AIN24,AIN12,AIN5,AINDMH,AINSTEER,AIN6"));
  bench.run_ms(100, host, bench.usb());
  const std::vector<std::string> lines = bench.usb_lines();
  for (const char* field : {"AIN24:5.00;", "AIN12:10.00;", "AIN5:15.00;", "AINDMH:20.00;",
                            "AINSTEER:25.00;", "AIN6:30.00;"}) {
    EXPECT_TRUE(has_line(lines, field)) << field;
  }
  EXPECT_EQ(bench.giga.core_conversions, by_core);

  bench.giga.converter_hangs = true;
  bench.run_ms(100, host, bench.usb());
  const std::vector<std::string> hung = bench.usb_lines();
  for (const char* field : {"AIN24:0.00;", "AIN12:0.00;", "AIN5:0.00;", "AINDMH:0.00;",
                            "AINSTEER:0.00;", "AIN6:0.00;"}) {
    EXPECT_TRUE(has_line(hung, field)) << field << " is an old voltage";
  }
}

// --- the wiring of each channel, as in the table of docs/how-to/firmware.md

// The pins of one channel of each kind.
struct Wires {
  giga::Pin step, direction, a, b, index, trigger, echo;
};
constexpr Wires wires[] = {
    {{'A', 3}, {'K', 5}, {'J', 0}, {'J', 1}, {'J', 14}, {'I', 14}, {'I', 10}},
    {{'A', 2}, {'K', 6}, {'J', 2}, {'J', 3}, {'J', 15}, {'H', 15}, {'I', 11}},
    {{'J', 8}, {'E', 6}, {'J', 4}, {'J', 5}, {'K', 3}, {'G', 12}, {'J', 12}},
    {{'A', 7}, {'K', 7}, {'J', 6}, {'J', 7}, {'K', 4}, {'I', 13}, {'G', 13}},
};

class GigaWiring : public testing::TestWithParam<int> {
 protected:
  GigaWiring() {
    for (const Wires& each : wires) {
      for (const giga::Pin pin : {each.a, each.b, each.index, each.echo}) set(pin, false);
    }
    bench_.boot();
    bench_.run_ms(150, host_, bench_.usb());
  }
  int channel() const { return GetParam(); }
  const Wires& mine() const { return wires[channel() - 1]; }
  void set(giga::Pin pin, bool high) { bench_.giga.set_pin(pin.port, pin.number, high); }
  bool pin(giga::Pin pin) { return bench_.giga.pin(pin.port, pin.number); }
  void command(const std::string& field) { bench_.usb()(host_.command(field)); }
  void run_ms(std::uint64_t ms) { bench_.run_ms(ms, host_, bench_.usb()); }
  // Expects `value` in the field of this channel of the newest state, and 0 in the fields of the
  // other channels.
  void expect_state(const char* name, const char* suffix, int value) {
    const std::vector<std::string> lines = bench_.usb_lines();
    const auto state = std::find_if(lines.rbegin(), lines.rend(), [&](const std::string& line) {
      return line.find(std::string(name) + "1" + suffix + ":") != std::string::npos;
    });
    ASSERT_NE(state, lines.rend());
    for (int i = 1; i <= 4; ++i) {
      const std::string field = name + std::to_string(i) + suffix + ":" +
                                std::to_string(i == channel() ? value : 0) + ";";
      EXPECT_NE(state->find(field), std::string::npos) << field << " is not in " << *state;
    }
  }

  GigaBench bench_;
  PlainHost host_;
};

TEST_P(GigaWiring, AStepperStepsAtItsOwnPins) {
  command("F:STEP1POS,STEP2POS,STEP3POS,STEP4POS");
  command("P:20,1000," + std::to_string(channel()));
  run_ms(50);
  expect_state("STEP", "POS", 20);
  EXPECT_TRUE(pin(mine().direction)) << "forward";
  command("P:-5,1000," + std::to_string(channel()));
  run_ms(50);
  expect_state("STEP", "POS", -5);
  for (const Wires& each : wires) {
    EXPECT_EQ(bench_.giga.rises(each.step.port, each.step.number), &each == &mine() ? 45 : 0);
    EXPECT_EQ(bench_.giga.rises(each.direction.port, each.direction.number),
              &each == &mine() ? 1 : 0);
    EXPECT_FALSE(pin(each.step)) << "the pulse of the last step has ended";
    EXPECT_FALSE(pin(each.direction)) << "backward, or as after power-up";
  }
}

TEST_P(GigaWiring, AnEncoderCountsItsOwnLines) {
  command("F:ENC1,ENC2,ENC3,ENC4,ENC1IDX,ENC2IDX,ENC3IDX,ENC4IDX");
  bool levels[2] = {};
  const auto turn = [&](int edges) {  // forward: A leads
    for (int i = 0; i < edges; ++i) {
      levels[i % 2] = !levels[i % 2];
      set(i % 2 == 0 ? mine().a : mine().b, levels[i % 2]);
    }
  };
  turn(8);
  set(mine().index, true);
  run_ms(2);
  set(mine().index, false);
  turn(4);
  run_ms(50);
  const std::vector<std::string> lines = bench_.usb_lines();
  ASSERT_FALSE(lines.empty());
  for (int i = 1; i <= 4; ++i) {
    const bool its_own = i == channel();
    const std::string n = std::to_string(i);
    EXPECT_TRUE(has_line({lines.back()}, "ENC" + n + (its_own ? ":12;" : ":0;"))) << lines.back();
    EXPECT_TRUE(has_line({lines.back()}, "ENC" + n + (its_own ? "IDX:8;" : "IDX:0;")))
        << lines.back();
  }
}

TEST_P(GigaWiring, AnEchoBelongsToTheTriggeredSensor) {
  command("F:US1,US2,US3,US4");
  bool answered = false;
  for (int i = 0; i < 600 && !answered; ++i) {
    bench_.turn();
    if (!pin(mine().trigger)) continue;
    while (pin(mine().trigger)) bench_.turn();
    set(mine().echo, true);
    bench_.giga.pass_us(100 * 58);
    set(mine().echo, false);
    answered = true;
  }
  ASSERT_TRUE(answered);
  run_ms(50);
  expect_state("US", "", 100);
}

INSTANTIATE_TEST_SUITE_P(Channels, GigaWiring, testing::Range(1, 5));

}  // namespace
}  // namespace r4::test
