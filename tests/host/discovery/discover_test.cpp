// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/discovery/discover.hpp"

#include <gtest/gtest.h>

#include <initializer_list>
#include <string>

#include "r4link/board.hpp"
#include "tests/support/problems.hpp"
#include "tests/transports/udp/search/answering_boards.hpp"

namespace r4::test {
namespace {

FoundBoard found_board(const std::string& url, const std::string& id) {
  FoundBoard board;
  board.url = url;
  if (!id.empty()) board.identity = BoardIdentity{"0.1.0", id, "udp", ""};
  return board;
}

Discovery discovery_of(std::initializer_list<FoundBoard> boards) {
  Discovery all;
  all.boards = boards;
  return all;
}

DiscoveryOptions by_udp(std::uint16_t port) {
  DiscoveryOptions options;
  options.serial = options.can = false;
  options.udp_port = port;
  return options;
}

TEST(Discovery, OnlyReturnsTheBoardThatWasFoundOnOneOrSeveralTransports) {
  EXPECT_EQ(discovery_of({found_board("udp:?id=b-1", "b-1")}).only().url, "udp:?id=b-1");
  EXPECT_EQ(discovery_of({found_board("serial:///dev/ttyACM0", "")}).only().url,
            "serial:///dev/ttyACM0");
  const Discovery on_several_transports =
      discovery_of({found_board("serial:///dev/ttyACM0", "b-1"),
                    found_board("can://can0?node=1", "b-1"), found_board("udp:?id=b-1", "b-1")});
  EXPECT_EQ(on_several_transports.only().url, "serial:///dev/ttyACM0");
}

TEST(Discovery, TheErrorForNoBoardNamesTheSearchedTransports) {
  Discovery all;
  all.ports.resize(2);
  all.ports[0].path = "/dev/ttyACM0";
  all.ports[0].asked = true;
  all.ports[1].path = "/dev/ttyS0";  // this port was not searched
  all.buses.resize(1);
  all.buses[0].interface = "can0";
  all.buses[0].trouble = Problem{ErrorKind::open, "can0", "it is down", ""};
  all.networks.resize(2);
  all.networks[0].interface = all.networks[1].interface = "lo";
  const Problem problem = problem_of([&] { all.only(); });
  EXPECT_EQ(problem.kind, ErrorKind::open);
  EXPECT_EQ(problem.reason, "no R4 board was found (searched /dev/ttyACM0, can0 (it is down), lo)");
}

TEST(Discovery, TheErrorForSeveralBoardsNamesTheirUrls) {
  for (const Discovery& all :
       {discovery_of({found_board("udp:?id=b-1", "b-1"), found_board("udp:?id=b-2", "b-2")}),
        // The same id twice on one transport, or a missing id, may mean two boards.
        discovery_of({found_board("udp:?id=b-1", "b-1"), found_board("udp:?id=b-2", "b-1")}),
        discovery_of({found_board("udp:?id=b-1", ""), found_board("udp:?id=b-2", "")})}) {
    const Problem problem = problem_of([&] { all.only(); });
    EXPECT_EQ(problem.kind, ErrorKind::usage);
    EXPECT_EQ(problem.fix, "open one of udp:?id=b-1, udp:?id=b-2");
  }
}

TEST(Discovery, SearchesOnlyUdpOnRequest) {
  AnsweringBoards boards;
  boards.add("0.1", {identity("b-1", "NAME:left;BUSY:1;")});
  const Discovery all = discover(by_udp(boards.port()));
  ASSERT_EQ(all.boards.size(), 1U);
  const FoundBoard& board = all.boards.front();
  EXPECT_EQ(board.url, "udp:?id=left&port=" + std::to_string(boards.port()));
  EXPECT_EQ(board.address, "127.0.0.1");
  EXPECT_EQ(board.place, "127.0.0.1");
  ASSERT_TRUE(board.identity);
  EXPECT_EQ(board.identity->board_id, "b-1");
  EXPECT_EQ(board.busy, true);
  EXPECT_FALSE(board.holder);
  EXPECT_TRUE(all.ports.empty() && all.buses.empty());
  EXPECT_FALSE(all.networks.empty());
  EXPECT_EQ(boards.asked("0.1"), 3);
}

TEST(Discovery, RefusesAPortAtWhichNoBoardListens) {
  EXPECT_EQ(problem_of([] { discover(by_udp(0)); }).kind, ErrorKind::usage);
}

TEST(Discovery, FirstOpensTheOnlyBoard) {
  AnsweringBoards boards;
  boards.add("0.1", {identity("b-1")});
  BoardOptions watching;
  watching.role = BoardRole::watch;  // uses a free port, not the port of hosts
  Board board = Board::first(watching, by_udp(boards.port()));
  EXPECT_EQ(board.name().find("udp://127.0.0.1"), 0U) << board.name();
  boards.remove("0.1");
  EXPECT_EQ(problem_of([&] { Board::first(watching, by_udp(boards.port())); }).kind,
            ErrorKind::open);
}

}  // namespace
}  // namespace r4::test
