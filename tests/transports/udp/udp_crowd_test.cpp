// SPDX-License-Identifier: GPL-3.0-or-later
// More hosts on a loop than are read one by one (udp_crowd.hpp).
#include "transports/udp/udp_crowd.hpp"

#include <gtest/gtest.h>

#include <asio/ip/udp.hpp>
#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "../recorder.hpp"
#include "tests/support/refused_calls.hpp"

namespace r4::test {
namespace {

// A board that says what it is told to, to one host.
struct TalkingBoard {
  explicit TalkingBoard(asio::io_context& io)
      : socket(io, asio::ip::udp::endpoint(asio::ip::make_address("127.0.0.1"), 0)) {}
  void say(std::string_view text) { socket.send_to(asio::buffer(text), host); }

  asio::ip::udp::socket socket;
  asio::ip::udp::endpoint host;
};

class UdpCrowdTest : public testing::Test {
 protected:
  static constexpr std::size_t boards_here = UdpCrowd::few + 4;

  UdpCrowdTest() : at_host(boards_here) {
    for (std::size_t i = 0; i < boards_here; ++i) {
      boards.push_back(std::make_unique<TalkingBoard>(io));
      hosts.emplace_back();
      open(i);
    }
  }
  void open(std::size_t i) {
    const auto port = std::to_string(boards[i]->socket.local_endpoint().port());
    hosts[i] = open_carrier(io, "udp://127.0.0.1:" + port + "?listen=0", Role::host, at_host[i]);
    const std::string& name = hosts[i]->name();
    boards[i]->host = {asio::ip::make_address("127.0.0.1"),
                       static_cast<std::uint16_t>(std::stoi(name.substr(name.rfind('=') + 1)))};
  }

  asio::io_context io;
  std::vector<std::unique_ptr<TalkingBoard>> boards;
  std::vector<Recorder> at_host;
  std::vector<std::unique_ptr<Carrier>> hosts;
};

TEST_F(UdpCrowdTest, EachHearsItsOwnBoardAllOfItInOrder) {
  constexpr int each = 30;  // more than are read at a time
  for (int n = 0; n < each; ++n) {
    for (std::size_t i = 0; i < boards_here; ++i) {
      boards[i]->say("board " + std::to_string(i) + " says " + std::to_string(n));
    }
  }
  ASSERT_TRUE(run_until(io, [&] {
    for (const Recorder& one : at_host) {
      if (one.datagrams.size() < each || one.drained == 0) return false;
    }
    return true;
  }));
  for (std::size_t i = 0; i < boards_here; ++i) {
    for (int n = 0; n < each; ++n) {
      EXPECT_EQ(at_host[i].datagrams[static_cast<std::size_t>(n)].text,
                "board " + std::to_string(i) + " says " + std::to_string(n));
    }
    EXPECT_EQ(hosts[i]->counters().rx_datagrams, static_cast<std::uint64_t>(each));
  }
}

TEST_F(UdpCrowdTest, WhatIsTooLongOrAStrangersIsCountedAndLeftOut) {
  TalkingBoard stranger(io);
  stranger.socket.close();
  stranger.socket = {io, asio::ip::udp::endpoint(asio::ip::make_address("127.0.0.2"), 0)};
  const std::size_t last = boards_here - 1;
  stranger.host = boards[last]->host;
  stranger.say("stranger");
  boards[last]->say(std::string(1025, 'x'));
  boards[last]->say("board");
  ASSERT_TRUE(run_until(io, [&] { return at_host[last].has("board"); }));
  EXPECT_EQ(at_host[last].datagrams.size(), 1U);
  EXPECT_EQ(at_host[last].oversize, std::vector<std::string>{std::string(1024, 'x')});
  EXPECT_EQ(hosts[last]->counters().rx_foreign, 1U);
  EXPECT_EQ(hosts[last]->counters().rx_oversize, 1U);
}

// Some of them in the very turn in which they would have been read.
TEST_F(UdpCrowdTest, WhoIsClosedByAnotherHearsNothingMoreAndMayOpenAgain) {
  const std::size_t first = boards_here - 4, last = boards_here - 1;
  for (std::size_t i = first; i <= last; ++i) {
    at_host[i].then = [this, i](const Recorder::Datagram&) {
      for (std::size_t other = first; other <= last; ++other) {
        if (other != i) hosts[other]->close();
      }
    };
    boards[i]->say("one of them");
  }
  const auto heard = [&] {
    std::size_t sum = 0;
    for (std::size_t i = first; i <= last; ++i) sum += at_host[i].datagrams.size();
    return sum;
  };
  ASSERT_TRUE(run_until(io, [&] { return heard() != 0; }));
  run_for(io, std::chrono::milliseconds(20));
  EXPECT_EQ(heard(), 1U);
  for (std::size_t i = first; i <= last; ++i) {
    at_host[i].then = nullptr;
    hosts[i].reset();
    open(i);
    boards[i]->say("again");
    ASSERT_TRUE(run_until(io, [&] { return at_host[i].has("again"); })) << i;
  }
}

TEST_F(UdpCrowdTest, ALoopWhoseHostsAreAllClosedEnds) {
  for (const auto& host : hosts) host->close();
  io.run_for(patience);
  EXPECT_TRUE(io.stopped());
}

TEST_F(UdpCrowdTest, WhereMuchComesItIsReadTogetherAndNothingIsLost) {
  const std::size_t last = boards_here - 1;
  std::size_t said = 0;
  const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(60);
  while (std::chrono::steady_clock::now() < end) {
    for (int n = 0; n < 40; ++n, ++said) boards[last]->say("state");
    run_for(io, std::chrono::milliseconds(1));
  }
  ASSERT_TRUE(run_until(io, [&] { return at_host[last].datagrams.size() == said; }));
  run_for(io, std::chrono::milliseconds(30));  // it is quiet again
  boards[last]->say("one more");
  ASSERT_TRUE(run_until(io, [&] { return at_host[last].has("one more"); }));
}

TEST_F(UdpCrowdTest, ALoopThatMayWaitForNothingMoreLooksAgainAndAgain) {
  in_a_thread_of_its_own([&] {
    refuse(no_watches);  // from now on: it waits already
    const std::size_t last = boards_here - 1;
    const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(60);
    while (std::chrono::steady_clock::now() < end) {
      for (int n = 0; n < 40; ++n) boards[last]->say("state");
      run_for(io, std::chrono::milliseconds(1));
    }
    run_for(io, std::chrono::milliseconds(30));  // it is quiet again
    boards[last]->say("one more");
    EXPECT_TRUE(run_until(io, [&] { return at_host[last].has("one more"); }));
  });
}

}  // namespace
}  // namespace r4::test
