// SPDX-License-Identifier: GPL-3.0-or-later
// Compares the bus model of the capacity tests with ISO 11898-1.
#include "tests/support/can_bus_model.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "r4link/can/can_ids.hpp"
#include "tests/transports/framing/can/can_frames.hpp"

namespace r4::test {
namespace {

constexpr std::uint64_t bit_ns = 1000;  // at 1 Mbit/s
constexpr std::uint64_t second_ns = 1000000000;

CanFrame frame(std::uint32_t id, const std::string& hex = "55 55") { return frame_of(id, hex); }
std::uint64_t bits(const CanFrame& frame) { return total(can_bits(frame)); }

// A bus with a node that receives and records the frames.
struct Bench {
  explicit Bench(const CanBusOptions& options = {}) : bus(options) {
    CanNodeOptions listener;
    listener.received = [this](const CanFrame& each) { heard.push_back({each.id, bus.now_ns()}); };
    bus.add_node(listener);
  }
  int sender(std::size_t room = 1000, CanQueue queue = CanQueue::mailboxes) {
    CanNodeOptions options;
    options.room = room;
    options.queue = queue;
    return bus.add_node(options);
  }
  std::vector<std::uint32_t> ids() const {
    std::vector<std::uint32_t> ids;
    for (const Heard& each : heard) ids.push_back(each.id);
    return ids;
  }

  struct Heard {
    std::uint32_t id;
    std::uint64_t at_ns;
    bool operator==(const Heard&) const = default;
  };
  std::vector<Heard> heard;
  CanBusModel bus;
};

using Ids = std::vector<std::uint32_t>;

TEST(CanBusModel, AFrameTakesItsBitTimesAndAnIntermission) {
  Bench bench;
  const int node = bench.sender();
  bench.bus.at(5000, [&] {
    bench.bus.send(node, frame(0x100));
    bench.bus.send(node, frame(0x101, "00 00 00 00 00 00 00 00"));
  });
  bench.bus.run_until(second_ns);
  const std::uint64_t first = bits(frame(0x100));
  const std::uint64_t second = bits(frame(0x101, "00 00 00 00 00 00 00 00"));
  ASSERT_EQ(bench.heard.size(), 2U);
  EXPECT_EQ(bench.heard[0].at_ns, 5000 + (first - 3) * bit_ns);
  EXPECT_EQ(bench.heard[1].at_ns, 5000 + (first + second - 3) * bit_ns);
  EXPECT_EQ(bench.bus.busy_ns(), (first + second) * bit_ns);
  EXPECT_EQ(bench.bus.traffic().at(0x100).max_latency_ns, (first - 3) * bit_ns);
  EXPECT_DOUBLE_EQ(bench.bus.load(), static_cast<double>((first + second) * bit_ns) / second_ns);
}

TEST(CanBusModel, TheLowestIdWinsAmongNodesAndWithinMailboxes) {
  Bench bench;
  const int one = bench.sender();
  const int two = bench.sender();
  for (const std::uint32_t id : {0x300U, 0x200U, 0x010U}) bench.bus.send(one, frame(id));
  for (const std::uint32_t id : {0x280U, 0x180U}) bench.bus.send(two, frame(id));
  bench.bus.run_until(second_ns);
  EXPECT_EQ(bench.ids(), (Ids{0x010, 0x180, 0x200, 0x280, 0x300}));
}

TEST(CanBusModel, AnUrgentFrameWaitsBehindOthersInAFifo) {
  Bench bench;
  const int fifo = bench.sender(1000, CanQueue::fifo);
  const int other = bench.sender();
  bench.bus.send(fifo, frame(0x300));
  bench.bus.send(fifo, frame(0x010));
  bench.bus.send(other, frame(0x200));
  bench.bus.run_until(second_ns);
  EXPECT_EQ(bench.ids(), (Ids{0x200, 0x300, 0x010}));
}

TEST(CanBusModel, AFrameInProgressIsNotInterrupted) {
  Bench bench;
  const int node = bench.sender();
  bench.bus.send(node, frame(0x400));
  bench.bus.send(node, frame(0x401));
  bench.bus.at(1, [&] { bench.bus.send(node, frame(emergency_stop_id)); });
  bench.bus.run_until(second_ns);
  EXPECT_EQ(bench.ids(), (Ids{0x400, emergency_stop_id, 0x401}));
  EXPECT_LE(bench.heard[1].at_ns, 270 * bit_ns);
}

TEST(CanBusModel, A29BitIdLosesToThe11BitsItBeginsWith) {
  Bench bench;
  const int one = bench.sender();
  const int two = bench.sender();
  CanFrame longer = frame(0x100U << 18);
  longer.extended = true;
  CanFrame lower = frame(0x0FFU << 18 | 0x3FFFF);
  lower.extended = true;
  bench.bus.send(one, longer);
  bench.bus.send(two, frame(0x100));
  bench.bus.send(one, lower);
  bench.bus.run_until(second_ns);
  EXPECT_EQ(bench.ids(), (Ids{lower.id, 0x100, longer.id}));
}

TEST(CanBusModel, AFullQueueRefusesAFrame) {
  Bench bench;
  const int node = bench.sender(2);
  EXPECT_TRUE(bench.bus.send(node, frame(1)));
  EXPECT_TRUE(bench.bus.send(node, frame(2)));
  EXPECT_FALSE(bench.bus.send(node, frame(3)));
  bench.bus.run_until(second_ns);
  EXPECT_TRUE(bench.bus.send(node, frame(3)));
}

TEST(CanBusModel, ADamagedFrameIsSentAgainAndCounted) {
  Bench bench;
  const int node = bench.sender();
  bench.bus.send(node, frame(0x100));
  bench.bus.corrupt_next(2);
  bench.bus.run_until(second_ns);
  EXPECT_EQ(bench.ids(), (Ids{0x100}));
  EXPECT_EQ(bench.bus.traffic().at(0x100).failed, 2U);
  // 7 bits of flags, 8 bits of delimiter and 3 bits of intermission replace the last 11 bits of the
  // frame.
  EXPECT_EQ(bench.bus.busy_ns(), (3 * bits(frame(0x100)) + 2 * 7) * bit_ns);
  EXPECT_EQ(bench.bus.transmit_errors(node), 2 * 8 - 1U);
  EXPECT_EQ(bench.bus.receive_errors(0), 2 - 1U);
}

TEST(CanBusModel, ASenderBecomesPassiveAfter16ErrorsAndBusOffAfter32) {
  Bench bench;
  std::vector<CanNodeState> states;
  CanNodeOptions options;
  options.changed = [&](CanNodeState state) { states.push_back(state); };
  const int node = bench.bus.add_node(options);
  bench.bus.send(node, frame(0x100));
  bench.bus.corrupt_next(32);
  bench.bus.run_until(second_ns);
  using enum CanNodeState;
  EXPECT_EQ(states, (std::vector<CanNodeState>{passive, bus_off, active}));
  EXPECT_EQ(bench.bus.traffic().at(0x100).failed, 32U);
  // After the 16th to the 31st error, a passive node waits for 8 bits before its next attempt.
  const std::uint64_t until_off = 32 * (bits(frame(0x100)) + 7) + 16 * 8;
  // 128 runs of 11 recessive bits. The end of the last error frame is the first run.
  const std::uint64_t back = until_off - 11 + std::uint64_t{128 * 11};
  ASSERT_EQ(bench.heard.size(), 1U);
  EXPECT_EQ(bench.heard[0].at_ns, (back + bits(frame(0x100)) - 3) * bit_ns);
  EXPECT_EQ(bench.bus.transmit_errors(node), 0U);
}

TEST(CanBusModel, AFrameEndsARunOfRecessiveBits) {
  Bench bench;
  const int node = bench.sender();
  const int other = bench.sender();
  bench.bus.send(node, frame(0x100));
  bench.bus.corrupt_next(32);
  const std::uint64_t until_off = (32 * (bits(frame(0x100)) + 7) + 16 * 8) * bit_ns;
  // The other frame begins ten bits after the bus is free, so a run of 21 bits is counted once. The
  // end of the other frame begins another run.
  bench.bus.at(until_off + 10 * bit_ns, [&] { bench.bus.send(other, frame(0x200)); });
  bench.bus.run_until(second_ns);
  ASSERT_EQ(bench.heard.size(), 2U);
  const std::uint64_t run_begins = until_off + (10 + bits(frame(0x200)) - 11) * bit_ns;
  EXPECT_EQ(bench.heard[1].at_ns,
            run_begins + (std::uint64_t{127 * 11} + bits(frame(0x100)) - 3) * bit_ns);
}

TEST(CanBusModel, ANodeThatStaysBusOffNeitherSendsNorHears) {
  Bench bench;
  int heard = 0;
  CanNodeOptions options;
  options.comes_back = false;
  options.received = [&](const CanFrame&) { ++heard; };
  const int node = bench.bus.add_node(options);
  bench.bus.send(node, frame(0x100));
  bench.bus.corrupt_next(32);
  bench.bus.run_until(second_ns);
  bench.bus.send(bench.sender(), frame(0x200));
  bench.bus.run_until(2 * second_ns);
  EXPECT_EQ(bench.ids(), (Ids{0x200}));
  EXPECT_EQ(bench.bus.waiting(node), 1U);
  EXPECT_EQ(heard, 0);
}

TEST(CanBusModel, ASenderAloneOnTheBusStaysPassive) {
  CanBusModel bus({});
  CanNodeOptions silent;
  silent.silent = true;
  bus.add_node(silent);
  const int node = bus.add_node({});
  bus.send(node, frame(0x100));
  bus.run_until(second_ns);
  EXPECT_EQ(bus.state(node), CanNodeState::passive);
  EXPECT_EQ(bus.transmit_errors(node), 128U);
  EXPECT_EQ(bus.traffic().at(0x100).frames, 0U);
  EXPECT_GT(bus.load(), 0.8) << "the sender tries for ever";
  bus.add_node({});
  bus.run_until(2 * second_ns);
  EXPECT_EQ(bus.traffic().at(0x100).frames, 1U);
}

TEST(CanBusModel, TwoNodesWithOneIdGoBusOffUnlessTheirFramesAreEqual) {
  Bench bench;
  const int one = bench.sender();
  const int two = bench.sender();
  bench.bus.send(one, frame(emergency_stop_id, "01"));
  bench.bus.send(two, frame(emergency_stop_id, "01"));
  bench.bus.run_until(second_ns);
  EXPECT_EQ(bench.ids(), (Ids{emergency_stop_id}));
  EXPECT_EQ(bench.bus.waiting(one) + bench.bus.waiting(two), 0U);

  bench.bus.send(one, frame(0x100, "01"));
  bench.bus.send(two, frame(0x100, "02"));
  bench.bus.run_until(second_ns + 3000000);
  EXPECT_EQ(bench.bus.state(one), CanNodeState::bus_off);
  EXPECT_EQ(bench.bus.state(two), CanNodeState::bus_off);
}

TEST(CanBusModel, ABabblingNodeStarvesOnlyLowerPriorities) {
  Bench bench;
  CanNodeOptions options;
  int babbler = 0;
  options.sent = [&](const CanFrame& sent) { bench.bus.send(babbler, sent); };
  babbler = bench.bus.add_node(options);
  bench.bus.send(babbler, frame(0x100));
  const int node = bench.sender();
  bench.bus.at(500000, [&] {
    bench.bus.send(node, frame(0x200));
    bench.bus.send(node, frame(0x010));
  });
  bench.bus.run_until(second_ns);
  EXPECT_EQ(bench.bus.traffic().at(0x010).frames, 1U);
  EXPECT_LE(bench.bus.traffic().at(0x010).max_latency_ns, 270 * bit_ns);
  EXPECT_EQ(bench.bus.traffic().count(0x200), 0U);
  EXPECT_GT(bench.bus.load(), 0.999);
}

TEST(CanBusModel, TheSameSeedGivesTheSameRun) {
  const auto run = [](std::uint64_t seed) {
    CanBusOptions options;
    options.seed = seed;
    options.corrupted = 0.2;
    options.missed = 0.1;
    Bench bench(options);
    const int node = bench.sender();
    for (std::uint32_t id = 0; id < 500; ++id) bench.bus.send(node, frame(id));
    bench.bus.run_until(second_ns);
    return bench.heard;
  };
  EXPECT_EQ(run(1), run(1));
  EXPECT_NE(run(1), run(2));
  EXPECT_LT(run(1).size(), 490U);
  EXPECT_GT(run(1).size(), 400U);
}

TEST(CanBusModel, AnFdFrameSwitchesToTheDataRate) {
  CanBusOptions options;
  options.rate = {1000000, 5000000};
  Bench bench(options);
  CanFrame fd = frame(0x100, counting(64));
  bench.bus.send(bench.sender(), fd);
  bench.bus.run_until(second_ns);
  ASSERT_EQ(bench.heard.size(), 1U);
  EXPECT_EQ(bench.heard[0].at_ns, time_ns(fd, options.rate) - 3 * bit_ns);
}

}  // namespace
}  // namespace r4::test
