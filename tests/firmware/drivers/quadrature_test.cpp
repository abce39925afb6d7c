// SPDX-License-Identifier: GPL-3.0-or-later
#include "firmware/drivers/quadrature.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

namespace r4::firmware {
namespace {

// A shaft with 4 counts a cycle. If the shaft turns forward, A leads B.
struct Shaft {
  void turn(int counts) {
    const int step = counts > 0 ? 1 : -1;
    for (; counts != 0; counts -= step) {
      at = (at + step) & 3;
      encoder.sample(a(), b());
    }
  }
  bool a() const { return at == 1 || at == 2; }
  bool b() const { return at == 2 || at == 3; }
  Shaft() { encoder.sample(a(), b()); }
  int at = 0;
  QuadratureEncoder encoder;
};

TEST(QuadratureEncoder, CountsFourPerCycleInBothDirections) {
  Shaft shaft;
  shaft.turn(8);
  EXPECT_EQ(shaft.encoder.count(), 8);
  shaft.turn(-13);
  EXPECT_EQ(shaft.encoder.count(), -5);
}

TEST(QuadratureEncoder, TheFirstSampleCountsNothing) {
  for (int levels = 0; levels < 4; ++levels) {
    QuadratureEncoder encoder;
    encoder.sample((levels & 2) != 0, (levels & 1) != 0);
    EXPECT_EQ(encoder.count(), 0);
  }
}

TEST(QuadratureEncoder, AChangeOfBothLinesCountsNothing) {
  QuadratureEncoder encoder;
  encoder.sample(false, false);
  encoder.sample(true, true);
  EXPECT_EQ(encoder.count(), 0);
  encoder.sample(false, false);
  EXPECT_EQ(encoder.count(), 0);
  encoder.sample(false, true);
  EXPECT_EQ(encoder.count(), -1);
  encoder.sample(true, false);
  EXPECT_EQ(encoder.count(), -1);
}

TEST(QuadratureEncoder, UnchangedLevelsCountNothing) {
  Shaft shaft;
  shaft.turn(3);
  for (int i = 0; i < 10; ++i) shaft.encoder.sample(shaft.a(), shaft.b());
  EXPECT_EQ(shaft.encoder.count(), 3);
}

TEST(QuadratureEncoder, TheIndexIsTheCountAtItsLastRisingEdge) {
  Shaft shaft;
  shaft.turn(5);
  EXPECT_EQ(shaft.encoder.index_count(), 0) << "no index yet";
  shaft.encoder.index(true);
  shaft.turn(1);
  shaft.encoder.index(true);
  EXPECT_EQ(shaft.encoder.index_count(), 5);
  EXPECT_EQ(shaft.encoder.count(), 6);
  shaft.encoder.index(false);
  shaft.turn(-8);
  EXPECT_EQ(shaft.encoder.index_count(), 5);
  shaft.encoder.index(true);
  EXPECT_EQ(shaft.encoder.index_count(), -2);
}

TEST(QuadratureEncoder, ZeroKeepsThePhysicalPositionOfTheIndex) {
  Shaft shaft;
  shaft.encoder.zero();
  EXPECT_EQ(shaft.encoder.index_count(), 0);
  shaft.turn(100);
  shaft.encoder.zero();
  EXPECT_EQ(shaft.encoder.index_count(), 0) << "no index yet";
  shaft.turn(5);
  shaft.encoder.index(true);
  shaft.turn(7);
  shaft.encoder.zero();
  EXPECT_EQ(shaft.encoder.count(), 0);
  EXPECT_EQ(shaft.encoder.index_count(), -7);
}

TEST(QuadratureEncoder, ZeroDoesNotDisturbTheMeasuredFrequency) {
  Shaft shaft;
  std::uint32_t now_us = 0xFFFF0000U;  // the clock wraps
  shaft.encoder.measure(now_us);
  for (int ms = 0; ms < 100; ++ms) {
    shaft.turn(-3);
    if (ms == 50) shaft.encoder.zero();
    now_us += 1000;
    shaft.encoder.measure(now_us);
  }
  EXPECT_EQ(shaft.encoder.frequency_hz(), -3000);
  shaft.encoder.measure(now_us + 100000);
  EXPECT_EQ(shaft.encoder.frequency_hz(), 0);
}

RC_GTEST_PROP(QuadratureEncoder, CountsWhatTheShaftTurns, (const std::vector<std::int8_t>& turns)) {
  Shaft shaft;
  int sum = 0;
  for (const std::int8_t counts : turns) {
    shaft.turn(counts);
    sum += counts;
  }
  RC_ASSERT(shaft.encoder.count() == sum);
}

}  // namespace
}  // namespace r4::firmware
