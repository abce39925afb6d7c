// SPDX-License-Identifier: GPL-3.0-or-later
// Every accepted form of a limit, and refused forms.
#include "tools/r4/recording/limits.hpp"

#include <gtest/gtest.h>

#include "tests/support/problems.hpp"

namespace r4::tool {
namespace {

using namespace std::chrono_literals;

TEST(RecordingLimits, ParseSizesAndTimes) {
  RecordingOptions options;
  take_rotation("500K", options);
  EXPECT_EQ(options.rotate_bytes, 500'000);
  take_rotation("2G", options);
  EXPECT_EQ(options.rotate_bytes, 2'000'000'000);
  take_rotation("30s", options);
  EXPECT_EQ(options.rotate_after, 30s);
  take_rotation("10min", options);
  EXPECT_EQ(options.rotate_after, 10min);
  take_rotation("1h", options);
  EXPECT_EQ(options.rotate_after, 1h);
  EXPECT_EQ(options.rotate_bytes, 2'000'000'000) << "both limits may be given";
  EXPECT_EQ(read_size("--keep", "10M"), 10'000'000);
}

TEST(RecordingLimits, RefuseOtherForms) {
  for (const char* const text :
       {"", "M", "0M", "-1M", "1", "1m", "1 M", "1.5G", "1MB", "1000001G", "1d"}) {
    RecordingOptions options;
    const Problem problem = test::problem_of([&] { take_rotation(text, options); });
    EXPECT_EQ(problem.kind, ErrorKind::usage) << text;
    EXPECT_TRUE(test::contains(problem.fix, "10min")) << text;
  }
  EXPECT_EQ(test::problem_of([] { read_size("--keep", "1h"); }).thing, "--keep 1h");
}

}  // namespace
}  // namespace r4::tool
