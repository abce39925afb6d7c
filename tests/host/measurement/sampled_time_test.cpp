// SPDX-License-Identifier: GPL-3.0-or-later
// The sampling times of states that a program receives over a socket and a terminal.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <chrono>

#include "tests/support/sampled_truth.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;

class SampledTime : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Transports, SampledTime, testing::Values("udp", "pty"),
                         [](const auto& transport) { return std::string(transport.param); });

TEST_P(SampledTime, IsWithinSevenTenthsOfAMillisecondAndItsErrorBound) {
  BoardInAThread simulated(GetParam());
  const SampledTruth found = look_at_sampled(simulated, simulated.url(), 700us);
  fmt::print(
      "{}: {} states, {} farther from the truth than told; told {} us, were {} us (median), {} us "
      "(worst)\n",
      GetParam(), found.states, found.dishonest, found.bound / 1us, found.median_error / 1us,
      found.worst_error / 1us);
  EXPECT_EQ(found.dishonest, 0U);
  EXPECT_LE(found.median_error, 700us);
  EXPECT_LE(found.bound, 1ms);
}

}  // namespace
}  // namespace r4::test
