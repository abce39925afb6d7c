// SPDX-License-Identifier: GPL-3.0-or-later
// Which places are wires of a session, and what is counted over them.
#include "protocol/link/session_wires.hpp"

#include <gtest/gtest.h>

namespace r4 {
namespace {

constexpr std::uint32_t timeout_ms = 1000;

struct SessionWiresTest : testing::Test {
  SessionWiresTest() { wires.begin(usb, beat(100), now); }

  // The host's heartbeat of that number.
  static SessionWires::Heartbeat beat(std::uint32_t pnum) { return {pnum, pnum * 77}; }
  SessionWires::Stranger from(Source place, SessionWires::Heartbeat heartbeat) {
    return wires.on_stranger(place, heartbeat, newest, timeout_ms, now);
  }
  void taken(std::uint32_t pnum, Source at = usb) {
    newest = pnum;
    wires.taken(at, beat(pnum), timeout_ms, now);
  }
  void pass(std::uint32_t ms) {
    now += ms;
    wires.poll(timeout_ms, now);
  }

  static constexpr Source usb{0, 0};
  static constexpr Source wifi{1, 7};
  static constexpr Source can{2, 0};
  using Stranger = SessionWires::Stranger;

  SessionWires wires;
  std::uint32_t now = 5000;
  std::uint32_t newest = 100;
};

TEST_F(SessionWiresTest, BeginsWithOne) {
  EXPECT_EQ(wires.size(), 1);
  EXPECT_TRUE(wires.has(usb));
  EXPECT_FALSE(wires.has(wifi));
  EXPECT_EQ(wires.joins(), 0U);
  SessionWires::Change change;
  EXPECT_FALSE(wires.take_change(change));
}

TEST_F(SessionWiresTest, OneOfTheLastEightHeartbeatsIsAProof) {
  for (std::uint32_t pnum = 101; pnum <= 108; ++pnum) taken(pnum);
  EXPECT_EQ(from(wifi, beat(100)), Stranger::unknown) << "it is the ninth";
  EXPECT_EQ(from(wifi, {101, 1}), Stranger::unknown) << "its bytes are others";
  EXPECT_EQ(from(wifi, beat(101)), Stranger::joined);
  SessionWires::Change change;
  ASSERT_TRUE(wires.take_change(change));
  EXPECT_TRUE(change.at == wifi && change.joined);
  EXPECT_FALSE(wires.take_change(change));
}

TEST_F(SessionWiresTest, AProofIsGoodForLessThanTheTimeout) {
  now += timeout_ms;
  EXPECT_EQ(from(wifi, beat(100)), Stranger::unknown);
  --now;
  EXPECT_EQ(from(wifi, beat(100)), Stranger::joined);
}

TEST_F(SessionWiresTest, WhoIsAheadWaitsForTheSession) {
  const std::uint32_t furthest = 100 + SessionWires::most_ahead;
  EXPECT_EQ(from(wifi, beat(furthest + 1)), Stranger::unknown) << "too far";
  EXPECT_EQ(from(wifi, beat(furthest)), Stranger::waits);
  EXPECT_EQ(from(wifi, beat(101)), Stranger::waits) << "the first one it brought counts";
  taken(101);
  EXPECT_FALSE(wires.has(wifi));
  taken(furthest);
  EXPECT_TRUE(wires.has(wifi));
}

TEST_F(SessionWiresTest, WhatTheSessionHasPassedIsReplacedByTheNext) {
  EXPECT_EQ(from(wifi, beat(101)), Stranger::waits);
  taken(102);  // 101 was lost there
  EXPECT_EQ(from(wifi, beat(103)), Stranger::waits);
  taken(103);
  EXPECT_TRUE(wires.has(wifi));
}

TEST_F(SessionWiresTest, NobodyWaitsForLongerThanTheTimeout) {
  EXPECT_EQ(from(wifi, beat(101)), Stranger::waits);
  now += timeout_ms;
  taken(101);
  EXPECT_FALSE(wires.has(wifi));
}

TEST_F(SessionWiresTest, WhoWaitsOnOnePortIsNotInTheWayOfAnother) {
  EXPECT_EQ(from(wifi, beat(101)), Stranger::waits);
  for (std::uint32_t peer = 0; peer < 100; ++peer) from(Source{3, peer}, {101, peer});
  taken(101);
  EXPECT_TRUE(wires.has(wifi));
  EXPECT_EQ(wires.size(), 2);
}

TEST_F(SessionWiresTest, ASilentWireLeavesButNotTheLast) {
  from(wifi, beat(100));
  for (std::uint32_t i = 0; i < 10; ++i) {
    pass(100);
    taken(101 + i);
  }
  wires.poll(timeout_ms, now);
  EXPECT_FALSE(wires.has(wifi));
  EXPECT_EQ(wires.losses(), 1U);
  pass(5000);
  EXPECT_TRUE(wires.has(usb));
  EXPECT_EQ(wires.losses(), 1U);
}

TEST_F(SessionWiresTest, ACopyKeepsItsWire) {
  from(wifi, beat(100));
  for (std::uint32_t i = 0; i < 20; ++i) {
    pass(100);
    taken(101 + i);
    wires.passed_over(wifi, i < 2 ? beat(100) : beat(99 + i), timeout_ms, now);
  }
  EXPECT_TRUE(wires.has(wifi));
  for (std::uint32_t i = 20; i < 32; ++i) {
    pass(100);
    taken(101 + i);
    wires.passed_over(wifi, {99 + i, 1}, timeout_ms, now);  // something else does not
  }
  EXPECT_FALSE(wires.has(wifi));
}

TEST_F(SessionWiresTest, ALostPortTakesItsWiresButNotTheLastOnes) {
  from(wifi, beat(100));
  from(Source{1, 8}, beat(100));
  EXPECT_FALSE(wires.port_lost(2));
  EXPECT_TRUE(wires.port_lost(1));
  EXPECT_EQ(wires.size(), 1);
  EXPECT_EQ(wires.losses(), 2U);
  EXPECT_FALSE(wires.port_lost(0));
  EXPECT_TRUE(wires.has(usb));
}

TEST_F(SessionWiresTest, CountsWhatIsLostOverAllAndWhatIsRepeatedByOne) {
  from(wifi, beat(100));
  EXPECT_FALSE(wires.count(usb, 200));
  EXPECT_TRUE(wires.count(wifi, 200)) << "a copy";
  EXPECT_FALSE(wires.count(wifi, 200)) << "repeated";
  EXPECT_EQ(wires.repeated(), 1U);
  EXPECT_FALSE(wires.count(usb, 203));
  EXPECT_EQ(wires.lost(), 2U);
  EXPECT_FALSE(wires.count(wifi, 201)) << "the other had lost it";
  EXPECT_EQ(wires.lost(), 1U);
  for (std::uint32_t pnum = 204; pnum < 400; ++pnum) wires.count(usb, pnum);
  for (std::uint32_t pnum = 204; pnum < 300; ++pnum) EXPECT_TRUE(wires.count(wifi, pnum));
  EXPECT_EQ(wires.lost(), 1U) << "what lags is no restart";
  EXPECT_EQ(wires.repeated(), 1U);
}

TEST_F(SessionWiresTest, ASessionThatBeginsForgetsTheOneBefore) {
  from(wifi, beat(100));
  from(can, beat(101));
  wires.begin(can, beat(9000), now);
  EXPECT_EQ(wires.size(), 1);
  EXPECT_TRUE(wires.has(can));
  newest = 9000;
  EXPECT_EQ(from(usb, beat(100)), Stranger::unknown);
  EXPECT_EQ(wires.losses(), 0U) << "nothing was lost: it has ended";
  EXPECT_EQ(from(usb, beat(9000)), Stranger::joined);
}

}  // namespace
}  // namespace r4
