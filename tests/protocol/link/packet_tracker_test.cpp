// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/messages/packet_tracker.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <set>
#include <vector>

#include "protocol/datagram/wrapping.hpp"

namespace r4 {
namespace {

std::vector<Arrival> feed(PacketTracker& tracker, std::initializer_list<std::uint32_t> numbers) {
  std::vector<Arrival> arrivals;
  for (const std::uint32_t number : numbers) arrivals.push_back(tracker.on(number));
  return arrivals;
}
using Arrivals = std::vector<Arrival>;

TEST(Newer, ComparesBySerialNumber) {
  EXPECT_TRUE(newer(1, 0));
  EXPECT_FALSE(newer(0, 1));
  EXPECT_FALSE(newer(7, 7));
  EXPECT_TRUE(newer(0, 0xffffffffU));
  EXPECT_TRUE(newer(0x7fffffffU, 0));
  EXPECT_TRUE(newer(5, 0x80000006U));
  EXPECT_FALSE(newer(0x80000006U, 5));
}

TEST(PacketTracker, DistinguishesTheNextNumberFromAGap) {
  PacketTracker tracker;
  EXPECT_FALSE(tracker.started());
  EXPECT_EQ(feed(tracker, {7434, 7435, 7436, 7440}),
            (Arrivals{Arrival::first, Arrival::next, Arrival::next, Arrival::gap}));
  EXPECT_TRUE(tracker.started());
  EXPECT_EQ(tracker.newest(), 7440U);
  EXPECT_EQ(tracker.counters().received, 4U);
  EXPECT_EQ(tracker.counters().lost, 3U);
}

TEST(PacketTracker, ALatePacketReducesTheLossCount) {
  PacketTracker tracker;
  EXPECT_EQ(feed(tracker, {1, 4, 2, 3}),
            (Arrivals{Arrival::first, Arrival::gap, Arrival::late, Arrival::late}));
  EXPECT_EQ(tracker.newest(), 4U);
  EXPECT_EQ(tracker.counters().lost, 0U);
  EXPECT_EQ(tracker.counters().late, 2U);
}

TEST(PacketTracker, RecognizesDuplicatesOfNewAndOldPackets) {
  PacketTracker tracker;
  EXPECT_EQ(feed(tracker, {1, 1, 2, 3, 2, 3, 1}),
            (Arrivals{Arrival::first, Arrival::duplicate, Arrival::next, Arrival::next,
                      Arrival::duplicate, Arrival::duplicate, Arrival::duplicate}));
  EXPECT_EQ(tracker.counters().duplicate, 4U);
  EXPECT_EQ(tracker.counters().lost, 0U);
}

TEST(PacketTracker, ALatePacketIsADuplicateTheSecondTime) {
  PacketTracker tracker;
  EXPECT_EQ(feed(tracker, {1, 3, 2, 2}),
            (Arrivals{Arrival::first, Arrival::gap, Arrival::late, Arrival::duplicate}));
}

TEST(PacketTracker, RemembersTheLast64Numbers) {
  PacketTracker tracker;
  tracker.on(1000);
  tracker.on(1064);  // 1000 is 64 numbers back, 1001 is 63
  EXPECT_EQ(tracker.on(1001), Arrival::late);
  EXPECT_EQ(tracker.on(1000), Arrival::old);
  EXPECT_EQ(tracker.counters().lost, 62U);
  EXPECT_EQ(tracker.counters().old, 1U);
}

TEST(PacketTracker, NumbersBeforeTheFirstAreOldAndNotLost) {
  PacketTracker tracker;
  EXPECT_EQ(feed(tracker, {10, 15, 8, 9, 9, 11}),
            (Arrivals{Arrival::first, Arrival::gap, Arrival::old, Arrival::old, Arrival::old,
                      Arrival::late}));
  EXPECT_EQ(tracker.newest(), 15U);
  EXPECT_EQ(tracker.counters().lost, 3U);
}

TEST(PacketTracker, TwoRisingNumbersFarOffAreARestartedSender) {
  for (const std::uint32_t begin : {0U, 100'000U, 2'000'000'000U, 4'000'000'000U}) {
    PacketTracker tracker;
    tracker.on(1'000'000);
    EXPECT_EQ(tracker.on(begin), Arrival::old) << begin;
    EXPECT_EQ(tracker.newest(), 1'000'000U);
    EXPECT_EQ(tracker.on(begin + 1), Arrival::restart) << begin;
    EXPECT_EQ(tracker.on(begin + 2), Arrival::next) << begin;
    EXPECT_EQ(tracker.on(begin + 1), Arrival::duplicate) << begin;
    EXPECT_EQ(tracker.on(begin), Arrival::duplicate) << begin;
    EXPECT_EQ(tracker.on(begin - 1), Arrival::old) << begin;
    EXPECT_EQ(tracker.counters().restarts, 1U);
    EXPECT_EQ(tracker.counters().lost, 0U);
  }
}

TEST(PacketTracker, OldNumbersThatDoNotRiseAreNotARestart) {
  PacketTracker tracker;
  EXPECT_EQ(feed(tracker, {1000, 5, 5, 4, 6, 1001, 7, 9, 8}),
            (Arrivals{Arrival::first, Arrival::old, Arrival::old, Arrival::old, Arrival::old,
                      Arrival::next, Arrival::old, Arrival::old, Arrival::old}));
  EXPECT_EQ(tracker.counters().restarts, 0U);
}

TEST(PacketTracker, AJumpWithinTheLimitIsALossAndBeyondItARestart) {
  PacketTracker tracker;
  tracker.on(0);
  EXPECT_EQ(tracker.on(PacketTracker::max_gap), Arrival::gap);
  EXPECT_EQ(tracker.counters().lost, PacketTracker::max_gap - 1);
  EXPECT_EQ(tracker.on(2 * PacketTracker::max_gap + 1), Arrival::old);
}

TEST(PacketTracker, ContinuesWhenTheNumbersWrap) {
  PacketTracker tracker;
  EXPECT_EQ(feed(tracker, {0xfffffffeU, 0xffffffffU, 1, 0, 0xffffffffU, 2}),
            (Arrivals{Arrival::first, Arrival::next, Arrival::gap, Arrival::late,
                      Arrival::duplicate, Arrival::next}));
  EXPECT_EQ(tracker.counters().lost, 0U);
}

TEST(PacketTracker, RestartBeginsANewCount) {
  PacketTracker tracker;
  tracker.restart();  // before the first datagram
  EXPECT_EQ(tracker.counters().restarts, 0U);
  tracker.on(500);
  tracker.restart();
  EXPECT_FALSE(tracker.started());
  EXPECT_EQ(tracker.on(1), Arrival::first);
  EXPECT_EQ(tracker.on(2), Arrival::next);
  EXPECT_EQ(tracker.counters().restarts, 1U);
  EXPECT_EQ(tracker.counters().lost, 0U);
}

TEST(PacketTracker, SaysWhichArrivalsAreTheNewest) {
  EXPECT_TRUE(is_current(Arrival::first));
  EXPECT_TRUE(is_current(Arrival::next));
  EXPECT_TRUE(is_current(Arrival::gap));
  EXPECT_TRUE(is_current(Arrival::restart));
  EXPECT_FALSE(is_current(Arrival::duplicate));
  EXPECT_FALSE(is_current(Arrival::late));
  EXPECT_FALSE(is_current(Arrival::old));
}

// Packet numbers in any order with duplicates, from any start: the tracker counts each number
// correctly while it remembers the number.
TEST(PacketTracker, CountsAnyShuffleWithinItsMemoryExactly) {
  rc::check([](std::uint32_t start) {
    PacketTracker tracker;
    tracker.on(start);
    std::uint32_t newest = start;
    std::set<std::uint32_t> seen{0};
    std::uint32_t duplicates = 0;
    const auto steps = *rc::gen::container<std::vector<int>>(200, rc::gen::inRange(-30, 8));
    for (const int step : steps) {
      const std::uint32_t number = newest + static_cast<std::uint32_t>(step);
      const std::uint32_t distance = number - start;
      if (static_cast<std::int32_t>(distance) < 0) continue;
      if (!seen.insert(distance).second) ++duplicates;
      tracker.on(number);
      if (newer(number, newest)) newest = number;
    }
    RC_ASSERT(tracker.newest() == newest);
    RC_ASSERT(tracker.counters().duplicate == duplicates);
    RC_ASSERT(tracker.counters().lost == newest - start + 1 - seen.size());
    RC_ASSERT(tracker.counters().restarts == 0U);
  });
}

}  // namespace
}  // namespace r4
