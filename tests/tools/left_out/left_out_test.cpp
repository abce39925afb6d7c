// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include <string>

#include "r4link/error.hpp"
#include "tools/r4/ros2/bridge.hpp"

namespace r4::tool {
namespace {

// The kind and the text of the error that `call` throws.
template <class Call>
std::string thrown_by(const Call& call) {
  try {
    call();
  } catch (const Error& error) {
    return (error.kind() == ErrorKind::unsupported ? "unsupported: " : "") +
           std::string(error.what());
  }
  return "nothing";
}

TEST(LeftOut, Ros2NamesItsBuildOptionAndTheMissingLibrary) {
  const std::string text = thrown_by([] { ros2::run_bridge({}); });
  EXPECT_TRUE(text.starts_with("unsupported: r4 ros2: ")) << text;
  EXPECT_NE(text.find("R4_ROS2=OFF"), std::string::npos) << text;
  EXPECT_NE(text.find("Cyclone DDS"), std::string::npos) << text;
}

}  // namespace
}  // namespace r4::tool
