// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include "tests/support/problems.hpp"
#include "tools/r4/ros2/bridge.hpp"

namespace r4::tool {
namespace {

TEST(LeftOut, Ros2NamesItsBuildOptionAndTheMissingLibrary) {
  const Problem problem = test::problem_of([] { ros2::run_bridge({}); });
  EXPECT_EQ(problem.kind, ErrorKind::unsupported);
  EXPECT_EQ(problem.thing, "r4 ros2");
  EXPECT_TRUE(test::contains(problem.text(), "R4_ROS2=OFF"));
  EXPECT_TRUE(test::contains(problem.text(), "Cyclone DDS"));
}

}  // namespace
}  // namespace r4::tool
