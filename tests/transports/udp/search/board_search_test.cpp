// SPDX-License-Identifier: GPL-3.0-or-later
#include "transports/udp/search/board_search.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <string>
#include <vector>

#include "answering_boards.hpp"
#include "r4link/datagram.hpp"
#include "r4link/discovery/url.hpp"
#include "r4link/error.hpp"

namespace r4::test {
namespace {

using Clock = std::chrono::steady_clock;

std::vector<std::string> ids(const BoardSearch::Result& found) {
  std::vector<std::string> ids;
  for (const AnsweredBoard& board : found.boards) ids.push_back(board.board_id);
  std::sort(ids.begin(), ids.end());
  return ids;
}

AnsweredBoard board(const std::string& address, const std::string& id,
                    const std::string& name = "") {
  AnsweredBoard board;
  board.address = asio::ip::make_address_v4(address);
  board.board_id = id;
  board.name = name;
  return board;
}

TEST(BoardSearch, ReportsTheAnswerAndTheAddressOfEachBoard) {
  AnsweringBoards boards;
  boards.add("0.2", {identity("one", "NAME:left;BUSY:1;")});
  boards.add("0.3", {identity("two", "BUSY:0;")});
  boards.add("0.4", {identity("old")});
  const BoardSearch::Result found = boards.search().run();
  EXPECT_FALSE(found.more);
  std::vector<std::string> answers;
  for (const AnsweredBoard& each : found.boards) {
    EXPECT_EQ(each.firmware, "0.1.0");
    EXPECT_EQ(each.capabilities, "udp");
    EXPECT_EQ(each.heard_at.to_string(), "127.0.0.1");
    const std::string busy = !each.busy ? "without BUSY" : *each.busy ? "busy" : "free";
    answers.push_back(each.board_id + " at " + each.address.to_string() + ' ' + each.name + ' ' +
                      busy);
  }
  std::sort(answers.begin(), answers.end());
  EXPECT_EQ(answers,
            (std::vector<std::string>{"old at 127.0.0.4  without BUSY",
                                      "one at 127.0.0.2 left busy", "two at 127.0.0.3  free"}));
}

TEST(BoardSearch, SendsOnlyTheIdentityQuestion) {
  asio::io_context io;
  asio::ip::udp::socket socket(io, {asio::ip::make_address("127.0.0.2"), 0});
  BoardSearch search;
  search.port = socket.local_endpoint().port();
  search.patience = std::chrono::milliseconds(5);
  search.networks = [] {
    return std::vector<BoardSearch::Network>{
        {"lo", 0, asio::ip::address_v4::loopback(), asio::ip::make_address_v4("127.0.0.2"), ""}};
  };
  EXPECT_TRUE(search.run().boards.empty());
  char buffer[100];
  asio::ip::udp::endpoint from;
  const std::size_t size = socket.receive_from(asio::buffer(buffer), from);
  EXPECT_EQ(std::string(buffer, size), with_crc("Q:ID;"));
  EXPECT_NE(from.port(), 2390) << "the search must leave that port to other programs";
}

TEST(BoardSearch, IgnoresDatagramsThatAreNotAnswersOfBoards) {
  AnsweringBoards boards;
  std::string damaged = identity("damaged");
  damaged[5] = 'S';
  boards.add("0.2",
             {"", "x", std::string("\0\xff", 2), std::string(2000, 'x'), std::string(60000, 'x'),
              damaged, with_crc("H:R4-ROS2;PNum:1;T:2;"), with_crc("AIN24:24.28;PNum:1;T:2;"),
              with_crc("N:1,BUSY;PNum:1;T:2;"), with_crc("I:R5,0.1.0,x,udp;PNum:1;T:2;"),
              with_crc("I:R4,0.1.0,x;PNum:1;T:2;"), with_crc("I:R4,0.1.0,,udp;PNum:1;T:2;"),
              identity(std::string(65, 'i')), with_crc("Q:ID;"), with_crc("E:STOP;PNum:1;")});
  boards.add("0.3", {"x", identity("real", "NAME:no name;BUSY:perhaps;")});
  const BoardSearch::Result found = boards.search().run();
  ASSERT_EQ(ids(found), std::vector<std::string>{"real"});
  EXPECT_EQ(found.boards[0].name, "");
  EXPECT_FALSE(found.boards[0].busy);
}

TEST(BoardSearch, AcceptsAnswersFromTheBoardPortOnly) {
  AnsweringBoards boards;
  boards.add("0.2", {identity("one")});
  boards.add_elsewhere("0.2", identity("other"));
  EXPECT_EQ(ids(boards.search().run()), std::vector<std::string>{"one"});
}

TEST(BoardSearch, KeepsOnly64BoardsAndReportsThatThereAreMore) {
  AnsweringBoards boards;
  for (int i = 1; i <= 100; ++i) {
    boards.add("1." + std::to_string(i), {identity("crowd-" + std::to_string(i))});
  }
  boards.add("2.1", {identity("wanted")}, 3);  // answers last
  const BoardSearch search = boards.search();
  const BoardSearch::Result found = search.run();
  EXPECT_EQ(found.boards.size(), BoardSearch::most_boards);
  EXPECT_TRUE(found.more);
  const BoardSearch::Result one = search.run("wanted");
  EXPECT_EQ(ids(one), std::vector<std::string>{"wanted"}) << "many other boards do not hide it";
  EXPECT_FALSE(one.more);
  EXPECT_EQ(one.others, BoardSearch::most_boards) << "the count of other boards has a limit";
}

TEST(BoardSearch, KeepsTheFirstAnswerOfEachAddressAndEndsInTime) {
  AnsweringBoards boards;
  std::vector<std::string> answers(20000, identity("flood"));
  answers.front() = identity("first");
  boards.add("0.2", answers);
  const auto begun = Clock::now();
  EXPECT_EQ(ids(boards.search().run()), std::vector<std::string>{"first"});
  EXPECT_LT(Clock::now() - begun, std::chrono::seconds(2));
}

TEST(BoardSearch, CountsABoardOnAllAddressesOfThisComputerOnce) {
  AnsweringBoards boards;
  boards.add("0.2", {identity("sim-1")});
  boards.add("0.3", {identity("sim-1")});
  BoardSearch search = boards.search();
  EXPECT_EQ(search.run().boards.size(), 2U) << "two boards of the same id";
  search.networks = [] {
    const auto own = [](const char* address) {
      return BoardSearch::Network{"lo", 0, asio::ip::make_address_v4(address),
                                  asio::ip::make_address_v4(address), ""};
    };
    return std::vector<BoardSearch::Network>{own("127.0.0.2"), own("127.0.0.3")};
  };
  EXPECT_EQ(search.run().boards.size(), 1U);
  EXPECT_EQ(search.run("another").others, 1U);
}

TEST(BoardSearch, ReportsWhyItCannotAsk) {
  BoardSearch search;
  search.patience = std::chrono::milliseconds(1);
  search.networks = [] {
    return std::vector<BoardSearch::Network>{{"gone0", 0, asio::ip::make_address_v4("192.0.2.1"),
                                              asio::ip::make_address_v4("192.0.2.255"), ""}};
  };
  const BoardSearch::Result found = search.run();
  ASSERT_EQ(found.networks.size(), 1U);
  EXPECT_NE(found.networks[0].trouble, "") << "this computer does not have the address";
  const FoundHost none = find_board(search, {});
  ASSERT_TRUE(none.problem);
  EXPECT_NE(none.problem->reason.find("nothing can be sent (gone0: "), std::string::npos)
      << none.problem->reason;
}

TEST(FindBoard, ListsSeveralBoardsWithTheirUrls) {
  AnsweringBoards boards;
  boards.add("0.2", {identity("one", "NAME:left;")});
  boards.add("0.3", {identity("two")});
  const FoundHost found = find_board(boards.search(), {});
  ASSERT_TRUE(found.problem);
  EXPECT_EQ(found.problem->kind, ErrorKind::usage);
  EXPECT_EQ(found.problem->reason, "several boards answered");
  const std::string port = "&port=" + std::to_string(boards.port());
  for (const std::string& url :
       {"udp:?id=left" + port + " (127.0.0.2)", "udp:?id=two" + port + " (127.0.0.3)"}) {
    EXPECT_NE(found.problem->fix.find(url), std::string::npos) << found.problem->fix;
  }
}

TEST(FindBoard, FindsABoardByNameAndById) {
  AnsweringBoards boards;
  boards.add("0.2", {identity("one", "NAME:left;")});
  boards.add("0.3", {identity("two", "NAME:right;")});
  for (const char* called : {"left", "one"}) {
    const FoundHost found = find_board(boards.search(), {called, ""});
    EXPECT_FALSE(found.problem) << called;
    EXPECT_EQ(found.board_id, "one") << called;
  }
  const FoundHost none = find_board(boards.search(), {"middle", ""});
  ASSERT_TRUE(none.problem);
  EXPECT_EQ(none.problem->kind, ErrorKind::open);
  EXPECT_NE(none.problem->reason.find("no board named 'middle' answered, but 2 other boards did"),
            std::string::npos)
      << none.problem->reason;
  EXPECT_NE(none.problem->fix.find("udp://"), std::string::npos) << none.problem->fix;
}

TEST(FindBoard, RefusesAnAmbiguousNameUnlessTheLastIdIsKnown) {
  AnsweringBoards boards;
  boards.add("0.2", {identity("one", "NAME:left;")});
  boards.add("0.3", {identity("two", "NAME:left;")});
  const FoundHost found = find_board(boards.search(), {"left", ""});
  ASSERT_TRUE(found.problem);
  EXPECT_EQ(found.problem->reason, "several boards are named 'left'");
  EXPECT_NE(found.problem->fix.find("udp:?id=one"), std::string::npos) << found.problem->fix;
  EXPECT_NE(found.problem->fix.find("udp:?id=two"), std::string::npos) << found.problem->fix;
  const FoundHost again = find_board(boards.search(), {"left", "two"});
  EXPECT_FALSE(again.problem) << "the id of the last board is known";
  EXPECT_EQ(again.addresses.at(0).to_string(), "127.0.0.3");
}

TEST(FindBoard, ReplacesABoardByOneOfItsNameButNotByAnother) {
  AnsweringBoards boards;
  boards.add("0.2", {identity("one", "NAME:left;")});
  EXPECT_TRUE(find_board(boards.search(), {"", "gone"}).problem);
  EXPECT_TRUE(find_board(boards.search(), {"", "left"}).problem)
      << "'left' is a name, but an id is wanted";
  EXPECT_FALSE(find_board(boards.search(), {"left", "gone"}).problem);
}

TEST(FindBoard, PrefersAnIdToTheSameTextAsAName) {
  const std::vector<AnsweredBoard> boards = {board("10.0.0.1", "a", "b"),
                                             board("10.0.0.2", "b", "c")};
  const std::vector<AnsweredBoard> meant = called(boards, "b");
  ASSERT_EQ(meant.size(), 1U);
  EXPECT_EQ(meant[0].address.to_string(), "10.0.0.2");
}

TEST(FindBoard, GivesEachBoardTheUrlThatFindsItAgain) {
  const std::vector<AnsweredBoard> boards = {
      board("10.0.0.1", "a", "left"), board("10.0.0.2", "b", "same"),
      board("10.0.0.3", "c", "same"), board("10.0.0.4", "d&?=%"),
      board("10.0.0.5", "twin"),      board("10.0.0.6", "twin"),
      board("10.0.0.7", "e", "a")};
  const char* const urls[] = {
      "udp:?id=left",   "udp:?id=b",      "udp:?id=c", "udp:?id=d%26%3F%3D%25",
      "udp://10.0.0.5", "udp://10.0.0.6", "udp:?id=e"};
  for (std::size_t i = 0; i < boards.size(); ++i) {
    EXPECT_EQ(url_of(boards[i], boards, 2018), urls[i]);
  }
  EXPECT_EQ(url_of(boards[0], boards, 2019), "udp:?id=left&port=2019");
  EXPECT_EQ(url_of(boards[4], boards, 2019), "udp://10.0.0.5:2019");
  EXPECT_EQ(Url::parse(urls[3]).get("id"), "d&?=%");
}

}  // namespace
}  // namespace r4::test
