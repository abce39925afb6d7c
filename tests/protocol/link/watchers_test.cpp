// SPDX-License-Identifier: GPL-3.0-or-later
// The leases of watchers, in virtual time.
#include "protocol/link/watchers.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace r4 {
namespace {

using Effect = Watchers::Effect;

constexpr Source here{0, 1};

Source place(std::uint32_t peer) { return {0, peer}; }

struct WatchersTest : testing::Test {
  Effect ask(Source from, std::uint64_t echo = 0, std::uint32_t rate_hz = 50) {
    return watchers.on_lease(from, rate_hz, echo, false, now);
  }
  // Sends W. Returns the token in the board's answer.
  std::uint32_t told(Source from) {
    now += Watchers::answer_spacing_ms;
    EXPECT_EQ(ask(from), Effect::unproven);
    watchers.tell(from, ++token, now);
    return token;
  }
  std::uint32_t watch(Source from, std::uint32_t rate_hz = 50) {
    const std::uint32_t echo = told(from);
    now += 3;
    EXPECT_EQ(ask(from, echo, rate_hz), Effect::watching);
    return echo;
  }

  Watchers watchers;
  std::uint32_t token = 70000;
  std::uint32_t now = 0xffffff00U;  // shortly before the clock wraps
};

TEST_F(WatchersTest, NothingStreamsBeforeTheEcho) {
  const std::uint32_t echo = told(here);
  EXPECT_FALSE(watchers.any());
  now += 5;
  EXPECT_EQ(ask(here, echo), Effect::watching);
  ASSERT_NE(watchers.find(here), nullptr);
  EXPECT_EQ(watchers.find(here)->period_ms, 20U);
}

TEST_F(WatchersTest, ATokenOfAnotherPeerIsNotAccepted) {
  const std::uint32_t echo = told(here);
  now += 30;
  EXPECT_EQ(ask(place(2), echo), Effect::unproven);
  EXPECT_EQ(ask(here, std::uint64_t{1} << 32 | echo), Effect::unproven);
  EXPECT_EQ(ask(here, echo + 1), Effect::unproven);
  EXPECT_FALSE(watchers.any());
  watch(here);
  now += 30;
  EXPECT_EQ(ask(place(2), token), Effect::unproven)
      << "the token of another watcher does not prove an address either";
}

TEST_F(WatchersTest, ATokenIsValidForOneLeaseTime) {
  const std::uint32_t echo = told(here);
  now += Watchers::lease_ms;
  EXPECT_EQ(ask(here, echo), Effect::watching);
  now += Watchers::lease_ms;
  EXPECT_EQ(ask(here, echo), Effect::unproven)
      << "a delayed datagram does not renew an expired lease";
}

TEST_F(WatchersTest, AFloodIsAnsweredFiftyTimesASecond) {
  int answers = 0;
  for (int ms = 0; ms < 1000; ++ms, ++now) {
    for (std::uint32_t i = 0; i < 10; ++i) {
      if (ask(place(100 + i)) != Effect::unproven) continue;
      ++answers;
      watchers.tell(place(100 + i), ++token, now);
    }
  }
  EXPECT_EQ(answers, 50);
  EXPECT_FALSE(watchers.any());
}

TEST_F(WatchersTest, AFloodDoesNotEndALease) {
  const std::uint32_t echo = watch(here);
  for (int ms = 0; ms < 5000; ++ms, ++now) {
    if (ask(place(100)) == Effect::unproven) watchers.tell(place(100), ++token, now);
    if (ms % 500 == 0) {
      EXPECT_EQ(ask(here, echo), Effect::watching);
    }
    watchers.poll(now);
  }
  EXPECT_NE(watchers.find(here), nullptr);
}

TEST_F(WatchersTest, ALeaseLastsTwoSecondsFromItsRenewal) {
  const std::uint32_t echo = watch(here);
  now += Watchers::lease_ms - 1;
  watchers.poll(now);
  EXPECT_TRUE(watchers.any());
  EXPECT_EQ(ask(here, echo, 100), Effect::watching);
  EXPECT_EQ(watchers.find(here)->period_ms, 10U);
  now += Watchers::lease_ms - 1;
  watchers.poll(now);
  EXPECT_TRUE(watchers.any());
  ++now;
  watchers.poll(now);
  EXPECT_FALSE(watchers.any());
}

TEST_F(WatchersTest, OnlyTheWatcherCanEndItsLease) {
  const std::uint32_t echo = watch(here);
  EXPECT_EQ(ask(here, 0, 0), Effect::ignored) << "a forged datagram";
  EXPECT_EQ(ask(place(2), echo, 0), Effect::ignored);
  EXPECT_EQ(ask(here, echo, 0), Effect::ended);
  EXPECT_FALSE(watchers.any());
}

TEST_F(WatchersTest, APeerThatCannotBeForgedNeedsNoEcho) {
  EXPECT_EQ(watchers.on_lease(here, 5, 0, true, now), Effect::watching);
  now += Watchers::lease_ms - 1;
  EXPECT_EQ(watchers.on_lease(here, 5, 0, true, now), Effect::watching);
  now += Watchers::lease_ms;
  watchers.poll(now);
  EXPECT_FALSE(watchers.any());
}

TEST_F(WatchersTest, HasRoomForFourWatchers) {
  for (std::uint32_t i = 1; i <= 4; ++i) watch(place(i));
  const std::uint32_t echo = told(place(5));
  EXPECT_EQ(ask(place(5), echo), Effect::full);
  watchers.end_of(place(2));
  EXPECT_EQ(ask(place(5), echo), Effect::watching);
  EXPECT_EQ(watchers.find(place(5))->pnum, 0U) << "the packet number restarts";
}

TEST_F(WatchersTest, EachWatcherGetsItsOwnRate) {
  watch(here, 30);
  Watcher& watcher = *watchers.find(here);
  int states = 0;
  for (std::uint32_t t = now; t - now < 3000; t += 10) states += watcher.take(t) ? 1 : 0;
  EXPECT_NEAR(states, 90, 3);
  states = 0;
  now += 10'000;  // ten seconds without service
  for (std::uint32_t t = now; t - now < 1000; t += 10) states += watcher.take(t) ? 1 : 0;
  EXPECT_NEAR(states, 30, 2) << "the watcher gets no extra states for the time without service";
}

}  // namespace
}  // namespace r4
