// SPDX-License-Identifier: GPL-3.0-or-later
#include "transports/can/can_turn.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace r4::test {
namespace {

using namespace std::chrono_literals;

const CanTurn::Time start{std::chrono::hours{1}};

// Sends ten heartbeats a second.
void talk(CanTurn& turn, CanTurn::Time from, std::chrono::milliseconds duration) {
  for (auto at = from; at <= from + duration; at += 100ms) turn.on_own(at);
}

TEST(CanTurn, IsOursIfNoOtherHostIsHeard) {
  CanTurn turn(1);
  turn.listen(start);
  EXPECT_FALSE(turn.ours(start + 119ms));
  EXPECT_FALSE(turn.others());
  EXPECT_TRUE(turn.ours(start + 120ms));
  talk(turn, start + 120ms, 2s);
  EXPECT_TRUE(turn.ours(start + 1h));
}

TEST(CanTurn, ALaterHostIsSilentUntilTheOtherEnds) {
  CanTurn turn(1);
  turn.listen(start);
  auto heard = start + 99ms;
  for (; heard < start + 5s; heard += 100ms) {
    EXPECT_FALSE(turn.on_other(heard)) << "this host has not sent yet";
    EXPECT_FALSE(turn.ours(heard + 99ms));
    EXPECT_TRUE(turn.others());
  }
  heard -= 100ms;
  EXPECT_FALSE(turn.ours(heard + CanTurn::silence - 1ms));
  EXPECT_TRUE(turn.ours(heard + CanTurn::silence + CanTurn::most_chance));
}

TEST(CanTurn, AHostThatHasTheTurnKeepsIt) {
  CanTurn turn(1);
  talk(turn, start, 0ms);
  EXPECT_FALSE(turn.on_other(start + 50ms));
  EXPECT_TRUE(turn.ours(start + 50ms));
}

TEST(CanTurn, AHostThatHasJustBegunYields) {
  CanTurn turn(1);
  turn.on_own(start);
  EXPECT_TRUE(turn.on_other(start + 49ms));
  EXPECT_FALSE(turn.ours(start + 50ms));
  EXPECT_FALSE(turn.on_other(start + 51ms)) << "this host is silent already";
}

TEST(CanTurn, AHostThatWasSilentForASecondIsANewcomer) {
  CanTurn turn(1);
  talk(turn, start, 10s);
  EXPECT_TRUE(turn.on_other(start + 11s))
      << "this host was held up, and another host has taken over";
  EXPECT_FALSE(turn.ours(start + 11s));

  CanTurn early(1);
  talk(early, start, 10s);
  EXPECT_FALSE(early.on_other(start + 10s + 999ms));
}

TEST(CanTurn, ListensAgainWhenTheBusIsUpAgain) {
  CanTurn turn(1);
  talk(turn, start, 1s);
  turn.listen(start + 1100ms);
  EXPECT_FALSE(turn.ours(start + 1200ms));
  EXPECT_FALSE(turn.on_other(start + 1200ms));
  EXPECT_TRUE(turn.others());
}

// Two hosts that begin in the same millisecond both become silent. One host returns first and keeps
// the turn.
TEST(CanTurn, GoesToOneOfTwoHostsThatBeginTogether) {
  for (std::uint32_t seed = 1; seed <= 100; ++seed) {
    CanTurn turns[] = {CanTurn(seed), CanTurn(seed + 1000)};
    int sent[2] = {};
    for (CanTurn& turn : turns) turn.listen(start);
    for (auto now = start; now < start + 20s; now += 1ms) {
      bool sends[2] = {};
      for (int i = 0; i < 2; ++i) {
        sends[i] = (now - start) % 100ms == 0ms && turns[i].ours(now);
        if (sends[i]) turns[i].on_own(now);
      }
      for (int i = 0; i < 2; ++i) {
        if (sends[i]) turns[1 - i].on_other(now);
        if (now >= start + 18s) sent[i] += sends[i];
      }
    }
    EXPECT_EQ(std::max(sent[0], sent[1]), 20) << seed;
    EXPECT_EQ(std::min(sent[0], sent[1]), 0) << seed;
  }
}

}  // namespace
}  // namespace r4::test
