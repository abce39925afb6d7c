// SPDX-License-Identifier: GPL-3.0-or-later
#include "firmware/ports/giga/chip/fdcan.hpp"

#include <gtest/gtest.h>

#include "fake_giga.hpp"
#include "tests/giga/core/registers.hpp"

namespace r4::test {
namespace {

using giga::CanState;
using giga::Fdcan;

CanFrame frame(std::uint32_t id, std::uint8_t first = 0) {
  CanFrame frame{};
  frame.id = id;
  frame.size = 8;
  for (int i = 0; i < 8; ++i) frame.data[i] = static_cast<std::uint8_t>(first + i);
  return frame;
}

class Controller {
 public:
  Controller() {
    EXPECT_TRUE(can.start(giga::can_bit_timing(60000000, 1000000), 0x010, 0x187, 0x607));
  }
  std::uint32_t now_us() const { return static_cast<std::uint32_t>(chip.now_ns() / 1000); }
  Fdcan::Event pass_ms(std::uint64_t ms) {
    Fdcan::Event last = Fdcan::Event::none;
    for (std::uint64_t i = 0; i < ms; ++i) {
      chip.pass_ms(1);
      const Fdcan::Event event = can.poll(now_us());
      if (event != Fdcan::Event::none) last = event;
    }
    return last;
  }
  fake::Giga chip;
  Fdcan can{*FDCAN2, r4_fake_message_ram};
};

TEST(CanBitTiming, SamplesAt86Point7Percent) {
  const giga::CanBitTiming timing = giga::can_bit_timing(60000000, 1000000);
  EXPECT_TRUE(timing.valid);
  EXPECT_EQ(timing.prescaler, 1U);
  EXPECT_EQ(timing.before_sample, 51U);
  EXPECT_EQ(timing.after_sample, 8U);
  for (const std::uint32_t mhz : {16U, 20U, 40U, 48U, 60U, 80U, 100U, 120U}) {
    const giga::CanBitTiming other = giga::can_bit_timing(mhz * 1000000, 1000000);
    ASSERT_TRUE(other.valid) << mhz;
    EXPECT_EQ(1 + other.before_sample + other.after_sample, mhz);
    EXPECT_NEAR((1.0 + other.before_sample) / mhz, 13.0 / 15, 0.025) << mhz;
  }
  EXPECT_FALSE(giga::can_bit_timing(10000000, 1000000).valid) << "too coarse";
  EXPECT_FALSE(giga::can_bit_timing(60500000, 1000000).valid) << "not a whole number";
}

TEST(Fdcan, DoesNotLoseAStopThatArrivesInTheHandler) {
  constexpr std::uint32_t fifo1_new = 1U << 4;
  Controller c;
  const std::uint32_t before = FDCAN2->IR.value & ~fifo1_new;
  FDCAN2->IR.value = before;
  FDCAN2->IR.on_read = [before] {
    FDCAN2->IR.value |= fifo1_new;  // just after the handler has read the register
    return before;
  };
  EXPECT_FALSE(c.can.on_interrupt());
  FDCAN2->IR.on_read = nullptr;
  EXPECT_TRUE(c.can.on_interrupt()) << "the request is still there";
}

TEST(Fdcan, WritesTheTimingInTheFormatOfTheRegister) {
  Controller c;
  EXPECT_EQ(FDCAN2->NBTP.value, 7U << 25 | 0U << 16 | 50U << 8 | 7U);
  EXPECT_EQ(FDCAN2->CCCR.value & 3U, 0U) << "the controller is on the bus";
}

TEST(Fdcan, DoesNotStartWithAnUnsuitableClock) {
  fake::Giga chip;
  Fdcan can(*FDCAN2, r4_fake_message_ram);
  EXPECT_FALSE(can.start(giga::can_bit_timing(10000000, 1000000), 0x010, 0x187, 0x607));
  EXPECT_EQ(can.state(), CanState::off);
  CanFrame out = frame(1);
  EXPECT_FALSE(can.send(out));
  EXPECT_FALSE(can.receive(out));
}

TEST(Fdcan, AcceptsOnlyTheStopAndItsOwnCommands) {
  Controller c;
  for (std::uint32_t id = 0; id <= max_can_id; ++id) {
    EXPECT_EQ(c.chip.can.deliver(frame(id)), id == 0x010 || id == 0x187 || id == 0x607) << id;
    CanFrame taken;
    while (c.can.receive(taken)) EXPECT_EQ(taken.id, id);
  }
}

TEST(Fdcan, ReceivesAFrameUnchanged) {
  Controller c;
  c.chip.can.deliver(frame(0x187, 0x21));
  CanFrame taken;
  ASSERT_TRUE(c.can.receive(taken));
  EXPECT_EQ(taken.size, 8);
  for (int i = 0; i < 8; ++i) EXPECT_EQ(taken.data[i], 0x21 + i);
  EXPECT_FALSE(c.can.receive(taken));
}

TEST(Fdcan, KeepsABurstOf7MillisecondsAndCountsLostFrames) {
  Controller c;
  for (int i = 0; i < 70; ++i) c.chip.can.deliver(frame(0x187, static_cast<std::uint8_t>(i)));
  c.can.poll(c.now_us());
  EXPECT_EQ(c.can.counters().lost, 1U);
  CanFrame taken;
  for (int i = 0; i < 64; ++i) {
    ASSERT_TRUE(c.can.receive(taken)) << i;
    EXPECT_EQ(taken.data[0], i);
  }
  EXPECT_FALSE(c.can.receive(taken));
}

TEST(Fdcan, AStopPassesAFullReceiveQueue) {
  Controller c;
  for (int i = 0; i < 70; ++i) c.chip.can.deliver(frame(0x187));
  c.chip.can.deliver(frame(0x010));
  CanFrame taken;
  ASSERT_TRUE(c.can.receive(taken));
  EXPECT_EQ(taken.id, 0x010U);
}

TEST(Fdcan, SendsInOrderAndRefusesFramesWhenFull) {
  Controller c;
  for (int i = 0; i < 8; ++i) {
    EXPECT_TRUE(c.can.send(frame(0x407, static_cast<std::uint8_t>(i)))) << i;
  }
  EXPECT_FALSE(c.can.send(frame(0x407)));
  c.pass_ms(2);
  ASSERT_EQ(c.chip.can.sent.size(), 8U);
  for (int i = 0; i < 8; ++i) {
    EXPECT_EQ(c.chip.can.sent[static_cast<std::size_t>(i)].data[0], i);
    EXPECT_EQ(c.chip.can.sent[static_cast<std::size_t>(i)].id, 0x407U);
  }
  EXPECT_TRUE(c.can.send(frame(0x407)));
}

TEST(Fdcan, AnUrgentFrameOvertakesTheQueue) {
  Controller c;
  for (int i = 0; i < 8; ++i) c.can.send(frame(0x407));
  EXPECT_TRUE(c.can.send_urgent(frame(0x027)));
  EXPECT_FALSE(c.can.send_urgent(frame(0x027))) << "one urgent frame at a time";
  c.pass_ms(2);
  EXPECT_EQ(c.chip.can.sent.front().id, 0x027U);
  EXPECT_EQ(c.chip.can.sent.size(), 9U);
}

TEST(Fdcan, LeavesBusOffAfterAWhileAndDropsWaitingFrames) {
  Controller c;
  for (int i = 0; i < 8; ++i) c.can.send(frame(0x407));
  c.chip.can.go_bus_off();
  EXPECT_EQ(c.can.poll(c.now_us()), Fdcan::Event::bus_off);
  EXPECT_EQ(c.can.state(), CanState::bus_off);
  EXPECT_FALSE(c.can.send(frame(0x407)));
  EXPECT_EQ(c.pass_ms(99), Fdcan::Event::none);
  EXPECT_EQ(FDCAN2->CCCR.value & 1U, 1U) << "not yet";
  c.pass_ms(3);
  EXPECT_EQ(FDCAN2->CCCR.value & 1U, 0U);
  c.pass_ms(3);
  EXPECT_EQ(c.can.state(), CanState::active);
  EXPECT_TRUE(c.chip.can.sent.empty()) << "waiting frames are old";
  EXPECT_TRUE(c.can.send(frame(0x407)));
  c.pass_ms(1);
  EXPECT_EQ(c.chip.can.sent.size(), 1U);
  EXPECT_EQ(c.can.counters().bus_offs, 1U);
}

TEST(Fdcan, DropsFramesThatAreNotAcknowledged) {
  Controller c;
  c.chip.can.acknowledged = false;
  c.can.send(frame(0x407));
  EXPECT_EQ(c.pass_ms(49), Fdcan::Event::none);
  EXPECT_EQ(c.pass_ms(3), Fdcan::Event::stale);
  c.chip.can.acknowledged = true;
  c.pass_ms(5);
  EXPECT_TRUE(c.chip.can.sent.empty());
}

TEST(Fdcan, AFullBusIsNotReportedAsStale) {
  Controller c;
  for (int i = 0; i < 200; ++i) {
    while (c.can.send(frame(0x407))) {
    }
    EXPECT_EQ(c.pass_ms(1), Fdcan::Event::none);
  }
}

TEST(Fdcan, ReportsItsErrorState) {
  Controller c;
  EXPECT_EQ(c.can.state(), CanState::active);
  FDCAN2->PSR.value = 1U << 6;
  EXPECT_EQ(c.can.state(), CanState::warning);
  FDCAN2->PSR.value = 3U << 5;
  EXPECT_EQ(c.can.state(), CanState::passive);
  FDCAN2->ECR.value = 130U << 8 | 17;
  EXPECT_EQ(c.can.transmit_errors(), 17U);
  EXPECT_EQ(c.can.receive_errors(), 2U) << "seven bits";
}

}  // namespace
}  // namespace r4::test
