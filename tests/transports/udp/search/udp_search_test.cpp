// SPDX-License-Identifier: GPL-3.0-or-later
// A UDP carrier that searches for its board: udp:auto and udp:?id=NAME.
#include <gtest/gtest.h>

#include <asio/post.hpp>

#include "../../recorder.hpp"
#include "answering_boards.hpp"
#include "transports/udp/udp_host.hpp"

namespace r4::test {
namespace {

using std::chrono::milliseconds;

class UdpSearchTest : public testing::Test {
 protected:
  UdpSearchTest() { lookup.retry = lookup.silence = milliseconds(20); }

  // Makes a host that is not open, and that searches for boards at two addresses.
  void make(const std::string& url) {
    BoardSearch search = boards.search({"0.2", "0.3"});
    search.patience = milliseconds(60);
    search.between = milliseconds(10);
    const std::string options = (url.find('?') == std::string::npos ? "?" : "&") +
                                std::string("listen=0&port=") + std::to_string(boards.port());
    host = std::make_unique<UdpHost>(io, Url::parse(url + options), std::make_shared<DeviceClaim>(),
                                     lookup, search);
  }
  // True if the given board answers this host.
  bool has_link(const std::string& id) {
    const std::size_t before = at_host.datagrams.size();
    host->send(with_crc("Q:ID;"), Priority::normal);
    const auto heard = [&] {
      for (std::size_t i = before; i < at_host.datagrams.size(); ++i) {
        if (at_host.datagrams[i].text.find("," + id + ",") != std::string::npos) return true;
      }
      return false;
    };
    return run_until(io, heard);
  }

  AnsweringBoards boards;
  asio::io_context io;
  HostLookup lookup;
  Recorder at_host;
  std::unique_ptr<Carrier> host;
};

TEST_F(UdpSearchTest, OpenedInAHandlerIsDownUntilTheBoardAnswers) {
  boards.add("0.9", {identity("elsewhere")});
  make("udp:auto");
  asio::post(io, [this] { host->open(at_host); });
  ASSERT_TRUE(run_until(io, [&] { return at_host.count(Kind::down) == 1; }));
  EXPECT_EQ(at_host.last(Kind::down)->problem.reason, "no R4 board answered (asked on lo)");
  EXPECT_EQ(host->send("too early", Priority::normal), SendResult::down);
  run_for(io, milliseconds(300));
  EXPECT_EQ(at_host.count(Kind::down), 1U) << "reported once";
  boards.add("0.3", {identity("one")});
  ASSERT_TRUE(run_until(io, [&] { return at_host.count(Kind::up) == 1; }));
  EXPECT_TRUE(has_link("one"));
}

TEST_F(UdpSearchTest, FollowsABoardThatMovesAndReportsIt) {
  for (const char* url : {"udp:auto", "udp:?id=left"}) {
    SCOPED_TRACE(url);
    boards.remove("0.3");
    boards.add("0.2", {identity("one", "NAME:left;")});
    at_host = Recorder();
    make(url);
    host->open(at_host);
    ASSERT_TRUE(has_link("one"));
    boards.remove("0.2");
    boards.add("0.3", {identity("one", "NAME:left;")});
    ASSERT_TRUE(run_until(io, [&] { return at_host.count(Kind::warning) == 1; }));
    EXPECT_EQ(at_host.last(Kind::warning)->problem.reason,
              "the board is at 127.0.0.3 now; it was at 127.0.0.2");
    EXPECT_EQ(host->name().find("udp://127.0.0.3:"), 0U) << host->name();
    EXPECT_TRUE(has_link("one"));
    EXPECT_EQ(at_host.count(Kind::down), 0U);
  }
}

TEST_F(UdpSearchTest, IsNotReplacedByAnotherBoard) {
  boards.add("0.2", {identity("one")});
  make("udp:auto");
  host->open(at_host);
  EXPECT_TRUE(host->up());
  ASSERT_TRUE(has_link("one"));
  boards.add("0.3", {identity("two")});
  boards.remove("0.2");
  const int before = boards.asked("0.3");
  ASSERT_TRUE(run_until(io, [&] { return boards.asked("0.3") > before + 6; })) << "two searches";
  EXPECT_EQ(host->name().find("udp://127.0.0.2:"), 0U) << host->name();
  EXPECT_EQ(at_host.count(Kind::warning), 0U);
  boards.add("0.2", {identity("one")});
  EXPECT_TRUE(has_link("one"));
}

}  // namespace
}  // namespace r4::test
