// SPDX-License-Identifier: GPL-3.0-or-later
// r4::Bridge between real transports: hosts, bridges and simulated boards in one process.
#include "r4link/bridge.hpp"

#include <gtest/gtest.h>

#include <string>

#include "r4link/board.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

TEST(Bridge, JoinsAWholeFleetInOrder) {
  Bridge bridge("udp://127.0.0.{1-3}:0", "sim:?node=7-9");
  ASSERT_EQ(bridge.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    Board board(bridge.status().at(i).hosts.name + "?listen=0");
    EXPECT_EQ(board.identify().board_id, "sim-" + std::to_string(7 + i));
    const BridgeStatus status = bridge.status().at(i);
    EXPECT_TRUE(status.hosts.up && status.board.up);
    EXPECT_GT(status.board.from.passed, 0U);
  }
}

TEST(Bridge, RefusesUrlsThatCannotBeJoined) {
  struct Case {
    const char* hosts;
    const char* board;
    const char* reason;
  };
  const char* const same = "both sides of the bridge are the same";
  const char* const several = "this gives several paths, and each side of a bridge has one path";
  const char* const no_key = "which does not need a key at its cable";
  const char* const no_transport = "the URL does not begin with a transport and a colon";
  for (const Case& each : {
           Case{"udp://127.0.0.1:2018", "udp://127.0.0.1:2018", same},
           Case{"can://can0?node=1", "can://can0", same},
           Case{"pty:/tmp/r4", "serial:///tmp/r4", same},
           Case{"udp://0.0.0.0:2018", "udp://localhost",
                "the bridge itself listens for hosts at this address"},
           Case{"udp://0.0.0.0:2390", "udp://192.0.2.1",
                "both sides would use the same port: one for the board, one for hosts"},
           Case{"udp://127.0.0.1:2100-2107", "can://can0?node=0-6",
                "the two sides give 8 and 7 transports"},
           Case{"udp://127.0.0.1:0", "can://can0?node=1-2",
                "the two sides give 1 and 2 transports"},
           Case{"udp://127.0.0.{1-2}:0", "can://can0?node={1,1}", "the board is named twice"},
           Case{"udp://127.0.0.{1,1}:0", "can://can0?node=0-1", "the board is named twice"},
           Case{"robot", "serial:auto", no_transport},
           Case{"udp://127.0.0.1:0", "robot", no_transport},
           Case{"sim:", "udp://192.0.2.1", "sim: is itself a board, so it cannot listen"},
           Case{"udp://127.0.0.1:0", "replay:/tmp/x",
                "a recording is not a board that can be driven"},
           Case{"udp://127.0.0.1:0",
                "pty:", "pty: is only for the side of the hosts, which open the other end"},
           Case{"udp://127.0.0.1:0", "serial:auto+udp://192.0.2.1", several},
           Case{"udp://127.0.0.1:0+pty:", "serial:auto", several},
           Case{"udp://0.0.0.0:0", "serial:auto", no_key},
           Case{"udp://[::]:0", "serial:///dev/r4", no_key},
           Case{"can://can0?node=3", "serial:auto", no_key},
       }) {
    const Problem problem = problem_of([&] { Bridge(each.hosts, each.board); });
    EXPECT_EQ(problem.kind, ErrorKind::usage) << each.hosts << ' ' << each.board;
    EXPECT_TRUE(contains(problem.reason, each.reason)) << each.hosts << ' ' << each.board;
    EXPECT_FALSE(problem.fix.empty()) << each.hosts << ' ' << each.board;
  }
}

TEST(Bridge, ABridgeToACableServesANetworkOnlyWithAKeyOrOnRequest) {
  const std::string away = "serial:///dev/r4-is-not-there";
  EXPECT_NO_THROW(Bridge("udp://127.0.0.1:0", away));
  BridgeOptions options;
  options.open = true;
  EXPECT_NO_THROW(Bridge("udp://0.0.0.0:0", away, options));
  options.keys.resize(1);
  options.keys[0].id = 1;
  EXPECT_EQ(problem_of([&] { Bridge("udp://0.0.0.0:0", away, options); }).kind, ErrorKind::usage);
  options.open = false;
  EXPECT_NO_THROW(Bridge("udp://0.0.0.0:0", away, options));
}

}  // namespace
}  // namespace r4::test
