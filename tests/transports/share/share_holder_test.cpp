// SPDX-License-Identifier: GPL-3.0-or-later
// A program that holds a transport, and how other programs may use the transport.
#include "transports/share/share_holder.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "shared_transport.hpp"
#include "tests/support/problems.hpp"
#include "tests/support/refused_calls.hpp"
#include "transports/share/share_message.hpp"
#include "transports/share/share_socket.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;
using Letter = ShareMessage::Kind;

class ShareHolderTest : public SharedTransportTest {
 protected:
  // A connection to the controlling program, without a carrier.
  FileDescriptor raw() {
    FileDescriptor connection = connect_to_holder(share, BoardRole::control);
    EXPECT_TRUE(connection);
    return connection;
  }
  // A connection as a sharing program, after its hello.
  FileDescriptor raw_watcher() {
    FileDescriptor connection = raw();
    EXPECT_EQ(send_message(connection.get(), Letter::hello, ShareMessage::version), 0);
    return connection;
  }
  std::vector<FileDescriptor> raw_watchers(std::size_t count) {
    std::vector<FileDescriptor> all;
    while (all.size() < count) {
      all.push_back(raw_watcher());
      std::array<char, 100> bytes;
      EXPECT_TRUE(in_time(
          [&] { return ::recv(all.back().get(), bytes.data(), bytes.size(), MSG_TRUNC) > 0; }));
    }
    return all;
  }
  // All packets until the holder closes the connection.
  std::vector<std::string> until_the_end(const FileDescriptor& connection) {
    std::vector<std::string> packets;
    EXPECT_TRUE(in_time([&] {
      std::array<char, 2048> bytes;
      while (true) {
        const ssize_t size = ::recv(connection.get(), bytes.data(), bytes.size(), MSG_TRUNC);
        if (size < 0 && errno == EAGAIN) return false;
        if (size == 0) return true;
        if (size > 0) packets.emplace_back(bytes.data(), static_cast<std::size_t>(size));
      }
    })) << "the holder did not close the connection";
    return packets;
  }
  static bool is_ended(const FileDescriptor& connection) {
    pollfd state{connection.get(), 0, 0};
    return ::poll(&state, 1, 0) == 1;
  }
};

TEST_F(ShareHolderTest, DropsStatesForASleepingProgramAndLaterSendsTheNewest) {
  const auto holder = opened(BoardRole::control);
  asio::io_context asleep;
  const auto sleeper = opened_in(asleep, BoardRole::watch);
  ASSERT_TRUE(in_time([&] {
    run_for(asleep, 1ms);
    return sleeper->carrier->up();
  }));
  const auto awake = opened(BoardRole::watch);
  for (int i = 0; i < 1000; ++i) {
    device.deliver(fmt::format("state {};{}", i, std::string(160, 'x')));
    ASSERT_TRUE(run_until(
        io, [&] { return awake->heard.datagrams.size() == static_cast<std::size_t>(i) + 1; }));
  }
  EXPECT_TRUE(in_time([&] {
    device.deliver("again");
    run_for(asleep, 5ms);
    return sleeper->has("again");
  }));
  EXPECT_LT(sleeper->heard.datagrams.size(), 300U);
}

TEST_F(ShareHolderTest, DisconnectsAProgramThatMissesAnEventOfTheTransport) {
  const auto holder = opened(BoardRole::control);
  const FileDescriptor sleeper = raw_watcher();
  const auto awake = opened(BoardRole::watch);
  const Problem unplugged{ErrorKind::open, "device:", "unplugged", "plug it in again"};
  for (int i = 0; i < 1000; ++i) {
    device.deliver("state;" + std::string(160, 'x'));
    ASSERT_TRUE(
        run_until(io, [&] { return awake->heard.datagrams.size() > static_cast<std::size_t>(i); }));
  }
  device.report({Kind::down, unplugged});
  ASSERT_TRUE(run_until(io, [&] { return awake->heard.count(Kind::down) == 1; }));
  EXPECT_FALSE(until_the_end(sleeper).empty());
}

TEST_F(ShareHolderTest, PassesOnlyStopsToTheBoard) {
  const auto holder = opened(BoardRole::control);
  using Case = std::pair<Letter, std::string>;
  for (const auto& [kind, text] : {
           Case{Letter::received, "SAFE:0;"},
           Case{Letter::sent, "O:358,1,1;"},
           Case{Letter::stop, "no datagram"},
           Case{Letter::stop, datagram_of("O", "358,1,1")},
           Case{Letter::stop, datagram_of("E", "CLEAR")},
           Case{Letter::stop, datagram_of("E", "LEAVE")},
           Case{Letter::stop, datagram_of("H", "ROS2-R4")},
           Case{Letter::event, text_of({CarrierEvent::Kind::up, {}})},
           Case{static_cast<Letter>('?'), "?"},
           Case{Letter::stop, std::string(max_datagram + 1, 'x')},
           Case{Letter::stop, std::string(3000, 'x')},
           Case{Letter::hello, "9, another version"},
       }) {
    const FileDescriptor connection = raw();
    ASSERT_EQ(send_message(connection.get(), kind, text), 0);
    EXPECT_EQ(until_the_end(connection), std::vector<std::string>{"w3"}) << text.substr(0, 20);
  }
  const FileDescriptor asks = raw();
  send_message(asks.get(), Letter::ask, ShareMessage::version);
  run_for(io, 20ms);
  EXPECT_TRUE(device.sent.empty());
  EXPECT_TRUE(holder->heard.datagrams.empty());
  EXPECT_TRUE(holder->carrier->up()) << "a controlling program keeps the transport";
}

TEST_F(ShareHolderTest, RefusesASeventeenthProgramUntilAnotherEnds) {
  const auto holder = opened(BoardRole::control);
  std::vector<FileDescriptor> sharers = raw_watchers(ShareHolder::most_served);
  const auto one_too_many = opened_in(io, BoardRole::watch);
  ASSERT_TRUE(run_until(io, [&] { return one_too_many->heard.count(Kind::down) == 1; }));
  EXPECT_EQ(one_too_many->heard.last(Kind::down)->problem.text(),
            "device:: 16 programs share it already, which is the limit; end one of these programs; "
            "its place is free at once");
  run_for(io, 1200ms);  // the program tries again and gets the same answer
  EXPECT_EQ(one_too_many->heard.count(Kind::down), 1U);
  device.deliver("not for it");
  sharers.pop_back();
  ASSERT_TRUE(run_until(io, [&] { return one_too_many->carrier->up(); }));
  EXPECT_TRUE(all_hear("state", one_too_many));
  EXPECT_FALSE(one_too_many->has("not for it"));
}

TEST_F(ShareHolderTest, PassesAndConfirmsTheStopOfASeventeenthProgram) {
  const auto holder = opened(BoardRole::control);
  const auto sharers = raw_watchers(ShareHolder::most_served);
  // `r4 stop` also opens the transport as a watcher.
  const auto stopper = opened_in(io, BoardRole::watch);
  EXPECT_EQ(stopper->carrier->send(stop, Priority::stop), SendResult::sent);
  ASSERT_TRUE(run_until(io, [&] { return stopper->carrier->up(); }));
  EXPECT_EQ(device.sent, std::vector<std::string>{stop});
  EXPECT_TRUE(all_hear("SAFE:2;", stopper));
  // A stop also works after the holder has reported that there is no place.
  const auto late = opened_in(io, BoardRole::watch);
  ASSERT_TRUE(run_until(io, [&] { return late->heard.count(Kind::down) == 1; }));
  EXPECT_EQ(late->carrier->send(stop, Priority::stop), SendResult::sent);
  ASSERT_TRUE(run_until(io, [&] { return late->carrier->up(); }));
}

TEST_F(ShareHolderTest, PassesAStopWithoutAHelloFromAnyNumberOfPrograms) {
  const auto holder = opened(BoardRole::control);
  const auto sharers = raw_watchers(ShareHolder::most_served);
  std::vector<FileDescriptor> others;
  for (std::size_t i = 1; i <= 10; ++i) {
    others.push_back(raw());  // sends nothing
    others.push_back(raw());
    EXPECT_EQ(send_message(others.back().get(), Letter::stop, stop), 0);
    ASSERT_TRUE(run_until(io, [&] { return device.sent.size() == i; })) << i;
  }
}

TEST_F(ShareHolderTest, RefusesStrangersOneAtATimeWithPauses) {
  if (::geteuid() != 0) GTEST_SKIP() << "needs root, to act as another user";
  const auto holder = opened(BoardRole::control);
  std::vector<FileDescriptor> strangers;
  while (strangers.size() < 20) strangers.push_back(foreign_socket(BoardRole::control, false));
  const auto turned_away = [&] {
    return std::count_if(strangers.begin(), strangers.end(), is_ended);
  };
  const auto began = Clock::now();
  ASSERT_TRUE(run_until(io, [&] { return turned_away() == 1; }));
  EXPECT_EQ(turned_away(), 1) << "the loop does other work between two strangers";
  ASSERT_TRUE(run_until(io, [&] { return turned_away() == 20; }));
  EXPECT_GE(Clock::now() - began, 19 * ShareHolder::between_arrivals);
}

// If the system refuses a call, the program must not end, because it may control a board.
TEST_F(ShareHolderTest, ContinuesIfTheSystemRefusesToWatchANewProgram) {
  in_a_thread_of_its_own([&] {
    const auto holder = opened(BoardRole::control);
    const auto watcher = opened(BoardRole::watch);
    refuse(no_watches);
    const FileDescriptor late = raw();
    EXPECT_TRUE(in_time([&] { return is_ended(late); }));
    EXPECT_TRUE(all_hear("state", watcher, holder));
    const auto told = program(BoardRole::watch, io);
    EXPECT_TRUE(contains(problem_of([&] { told->open(); }).reason, "limit of epoll watches"))
        << "the system refuses the wait for the holder";
  });
}

}  // namespace
}  // namespace r4::test
