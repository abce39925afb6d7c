// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/r4/boards/board_set.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <vector>

#include "r4link/link.hpp"
#include "tests/support/at_will.hpp"
#include "tests/support/problems.hpp"

namespace r4::tool {
namespace {

using namespace std::chrono_literals;
using test::at_will;

TEST(BoardSet, NumbersTheBoardsOfAllPatternsInTheirOrder) {
  BoardSet boards({"udp://127.0.0.1:20000-20001", "sim:?node=4"}, at_will());
  ASSERT_EQ(boards.size(), 3U);
  EXPECT_EQ(boards[1].url, "udp://127.0.0.1:20001");
  for (std::size_t i = 0; i < boards.size(); ++i) EXPECT_EQ(boards[i].index, i);
  EXPECT_THROW(BoardSet({"sim:?node=1", "sim:?node=1"}, at_will()), Error);
}

TEST(BoardSet, EndsAllSessionsAtOnce) {
  BoardSet boards({"sim:?node=1", "sim:?node=2"}, at_will());
  std::vector<int> states(boards.size());
  for (SetBoard& each : boards) {
    each.board.on_state([&, index = each.index](const ReceivedState&, const Datagram&) {
      ++states[index];
      if (boards[0].board.in_control() && boards[1].board.in_control()) boards.stop();
    });
  }
  boards.open();
  boards.end_by_signal(5s);
  boards.run();
  EXPECT_GT(states[0], 0);
  EXPECT_GT(states[1], 0);
  boards.leave();
  for (const SetBoard& each : boards) EXPECT_FALSE(each.board.in_control()) << each.url;
  EXPECT_NO_THROW(boards.require_heard());
}

TEST(BoardSet, NamesTheBoardThatWasNotHeard) {
  BoardSet boards({"sim:?node=1", "udp://127.0.0.1:9"}, watching(""));
  boards.open();
  boards.end_by_signal(300ms);
  boards.run();
  boards.leave();
  const Problem problem = test::problem_of([&] { boards.require_heard(); });
  EXPECT_EQ(problem.kind, ErrorKind::refused);
  EXPECT_TRUE(test::contains(problem.thing, "127.0.0.1:9"));
}

TEST(BoardSet, WithoutBoardsEndsAtOnce) {
  BoardSet boards;
  boards.end_by_signal(10ms);
  boards.run();
  boards.leave();
}

TEST(BoardSet, AsksForTheFieldsOfTheDevicesToo) {
  BoardOptions options;
  ask_for(options, "DEFAULT", {Device::from("bno055@0x28")});
  EXPECT_TRUE(options.session.fields.starts_with("DEFAULT,")) << options.session.fields;
  const BoardOptions watched = watching("", "ENC1");
  EXPECT_EQ(watched.role, BoardRole::watch);
  EXPECT_EQ(watched.session.fields, "ENC1");
}

TEST(BoardSet, RecognizesTheUrlOfAWholeBus) {
  EXPECT_EQ(whole_bus("can://can0"), "can0");
  for (const char* other :
       {"can://can0?node=3", "can://can0+can://can1", "udp://127.0.0.1", "serial:auto", "sim:"}) {
    EXPECT_EQ(whole_bus(other), "") << other;
  }
}

}  // namespace
}  // namespace r4::tool
