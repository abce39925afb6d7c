// SPDX-License-Identifier: GPL-3.0-or-later
#include "transports/adaptive_polling.hpp"

#include <gtest/gtest.h>

namespace r4 {
namespace {

using namespace std::chrono_literals;
using Silence = AdaptivePolling::Silence;

class AdaptivePollingTest : public testing::Test {
 protected:
  // A silence of the given kind and length, followed by an arrival.
  void silence(Silence kind, AdaptivePolling::Duration length) {
    polling.on_silence(kind, now);
    now += length;
    polling.on_arrival(now);
  }
  bool worthwhile_after(Silence kind, AdaptivePolling::Duration length) {
    polling.on_silence(kind, now);
    return polling.worthwhile(now + length);
  }

  AdaptivePolling polling{400us};
  AdaptivePolling::Time now{1h};
};

TEST_F(AdaptivePollingTest, SleepsBeforeTheFirstFrame) {
  EXPECT_FALSE(polling.worthwhile(now));
  EXPECT_FALSE(worthwhile_after(Silence::within, 0us));
  EXPECT_FALSE(worthwhile_after(Silence::between, 0us));
}

TEST_F(AdaptivePollingTest, StaysAwakeAfterAShortSilenceUpToItsLimit) {
  silence(Silence::between, 400us);
  EXPECT_FALSE(polling.worthwhile(now)) << "no silence has begun";
  EXPECT_TRUE(worthwhile_after(Silence::between, 0us));
  EXPECT_TRUE(worthwhile_after(Silence::between, 399us));
  EXPECT_FALSE(worthwhile_after(Silence::between, 400us));
}

TEST_F(AdaptivePollingTest, SleepsAfterALongSilence) {
  silence(Silence::between, 10us);
  silence(Silence::between, 401us);
  EXPECT_FALSE(worthwhile_after(Silence::between, 0us));
  silence(Silence::between, 10us);
  EXPECT_TRUE(worthwhile_after(Silence::between, 0us));
}

// A state every 10 ms. The frames of a state follow each other at once.
TEST_F(AdaptivePollingTest, DistinguishesASilenceWithinATransferFromOneBetween) {
  silence(Silence::within, 15us);
  silence(Silence::between, 10ms);
  EXPECT_FALSE(worthwhile_after(Silence::between, 0us));
  polling.on_arrival(now += 10ms);
  EXPECT_TRUE(worthwhile_after(Silence::within, 100us));
}

TEST_F(AdaptivePollingTest, RepeatedReportsDoNotRestartASilence) {
  silence(Silence::between, 10us);
  polling.on_silence(Silence::between, now);
  polling.on_silence(Silence::between, now + 300us);
  EXPECT_FALSE(polling.worthwhile(now + 400us));
}

}  // namespace
}  // namespace r4
