// SPDX-License-Identifier: GPL-3.0-or-later
#include "protocol/link/session_paths.hpp"

#include <gtest/gtest.h>

namespace r4 {
namespace {

constexpr Source path_a{0, 1}, path_b{1, 1}, path_c{1, 2}, path_d{2, 1}, path_e{3, 1};
constexpr std::uint32_t silence = 1000;

struct SessionPathsTest : testing::Test {
  SessionPathsTest() { paths.begin(path_a, 0); }
  int left_by(std::uint32_t now) {
    int count = 0;
    while (paths.take_silent(silence, now, left)) ++count;
    return count;
  }

  SessionPaths paths;
  Source left;
};

TEST_F(SessionPathsTest, BeginWithOnePath) {
  EXPECT_EQ(paths.size(), 1);
  EXPECT_EQ(paths[0], path_a);
  EXPECT_TRUE(paths.has(path_a));
  EXPECT_FALSE(paths.has(path_b));
  EXPECT_EQ(paths.joins(), 0U);
}

TEST_F(SessionPathsTest, AreFourAtMost) {
  for (const Source from : {path_b, path_c, path_d}) EXPECT_TRUE(paths.on_heartbeat(from, 1));
  EXPECT_FALSE(paths.on_heartbeat(path_e, 1));
  EXPECT_FALSE(paths.has(path_e));
  EXPECT_EQ(paths.size(), SessionPaths::most);
  EXPECT_EQ(paths.joins(), 3U);
}

TEST_F(SessionPathsTest, RemovesASilentPathButNotTheLast) {
  paths.on_heartbeat(path_b, 500);
  EXPECT_EQ(left_by(999), 0);
  EXPECT_EQ(left_by(1000), 1);
  EXPECT_EQ(left, path_a);
  EXPECT_EQ(left_by(5000), 0);
  EXPECT_TRUE(paths.has(path_b));
  EXPECT_EQ(paths.losses(), 1U);
}

TEST_F(SessionPathsTest, AHeartbeatKeepsItsPath) {
  paths.on_heartbeat(path_b, 500);
  EXPECT_FALSE(paths.on_heartbeat(path_a, 900)) << "the session has this path already";
  EXPECT_EQ(left_by(1499), 0);
}

TEST_F(SessionPathsTest, ALostPortRemovesAllItsPaths) {
  paths.on_heartbeat(path_b, 1);
  paths.on_heartbeat(path_c, 1);
  EXPECT_FALSE(paths.take_port(2, left));
  EXPECT_TRUE(paths.take_port(1, left));
  EXPECT_TRUE(paths.take_port(1, left));
  EXPECT_FALSE(paths.take_port(1, left));
  EXPECT_EQ(paths.size(), 1);
  EXPECT_TRUE(paths.take_port(0, left));
  EXPECT_EQ(paths.size(), 0);
}

TEST_F(SessionPathsTest, CountLossOverAllPathsAndDuplicatesPerPath) {
  paths.on_heartbeat(path_b, 1);
  EXPECT_FALSE(paths.count(path_a, 10));
  EXPECT_TRUE(paths.count(path_b, 10)) << "another path brought this datagram";
  EXPECT_FALSE(paths.count(path_b, 12));
  EXPECT_FALSE(paths.count(path_b, 12)) << "a duplicate on the same path";
  EXPECT_TRUE(paths.count(path_a, 12));
  EXPECT_EQ(paths.lost(), 1U);
  EXPECT_EQ(paths.repeated(), 1U);
  EXPECT_FALSE(paths.count(path_a, 11));
  EXPECT_EQ(paths.lost(), 0U);
  for (std::uint32_t pnum = 13; pnum < 120; ++pnum) paths.count(path_a, pnum);
  EXPECT_TRUE(paths.count(path_b, 14)) << "a slow path is not a restart";
  EXPECT_TRUE(paths.count(path_b, 15));
}

TEST_F(SessionPathsTest, AResumedSessionKeepsItsCountButOnlyOnePath) {
  paths.on_heartbeat(path_b, 1);
  paths.count(path_a, 10);
  paths.resume(path_c, 3000);
  EXPECT_EQ(paths.size(), 1);
  EXPECT_TRUE(paths.has(path_c));
  paths.count(path_c, 13);
  EXPECT_EQ(paths.lost(), 2U);
}

TEST_F(SessionPathsTest, ANewSessionCountsItsOwnNumbers) {
  paths.count(path_a, 10);
  paths.begin(path_b, 10);
  paths.count(path_b, 1'000'000);
  EXPECT_EQ(paths.lost(), 0U);
}

}  // namespace
}  // namespace r4
