// SPDX-License-Identifier: GPL-3.0-or-later
// What a program that holds a wire lets others do, and what becomes of those who do anything else.
#include "transports/share/wire_holder.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <asio/post.hpp>
#include <cerrno>
#include <cstddef>
#include <future>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "shared_wire.hpp"
#include "tests/support/refused_calls.hpp"
#include "transports/share/share_message.hpp"
#include "transports/share/share_socket.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;
using Letter = ShareMessage::Kind;

class HeldWire : public SharedWireTest {
 protected:
  // A connection of no carrier: what a forger has.
  FileDescriptor raw() {
    FileDescriptor connection = reach_holder({wire}).connection;
    EXPECT_TRUE(connection);
    return connection;
  }
  // One that watches.
  FileDescriptor raw_watcher() {
    FileDescriptor connection = raw();
    EXPECT_EQ(send_message(connection.get(), Letter::hello, hello_text(BoardRole::watch, "raw")),
              0);
    return connection;
  }
  std::vector<FileDescriptor> raw_watchers(std::size_t count) {
    std::vector<FileDescriptor> all;
    while (all.size() < count) all.push_back(raw_watcher());
    run_for(io, 20ms);
    return all;
  }
  // All that the holder says until it ends the connection, as packets; none if it does not.
  std::optional<std::vector<std::string>> last_words(const FileDescriptor& connection) {
    std::vector<std::string> packets;
    const bool ended = in_time([&] {
      std::array<char, 2048> bytes;
      while (true) {
        const ssize_t size = receive_packet(connection.get(), bytes.data(), bytes.size());
        if (size < 0 && errno == EAGAIN) return false;
        if (size == 0) return true;
        if (size > 0) packets.emplace_back(bytes.data(), static_cast<std::size_t>(size));
      }
    });
    if (!ended) return std::nullopt;
    return packets;
  }
  // The reason that a refused one was told, which is the last thing that it was told.
  std::string refusal(const FileDescriptor& connection) {
    const auto packets = last_words(connection);
    if (!packets) return "still there";
    if (packets->empty()) return "told nothing";
    const auto message = read_share_message(packets->back());
    if (!message || message->kind != Letter::down) return "told something else";
    EXPECT_EQ(message->problem.thing, "device:");
    EXPECT_FALSE(message->problem.fix.empty());
    return message->problem.reason;
  }

  // A connection of another user's program, which only root can be, too.
  FileDescriptor stranger() {
    const std::string name = "r4link/0/" + wire;
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    name.copy(address.sun_path + 1, name.size());
    const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
    EXPECT_EQ(::seteuid(65534), 0);
    FileDescriptor connection(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0));
    EXPECT_EQ(::connect(connection.get(), reinterpret_cast<const sockaddr*>(&address), size), 0);
    EXPECT_EQ(::seteuid(0), 0);
    return connection;
  }
  static bool is_ended(const FileDescriptor& connection) {
    pollfd state{connection.get(), 0, 0};
    return ::poll(&state, 1, 0) == 1;
  }

  const std::string stop = datagram_of("E", "STOP");
  const std::string full = "16 programs share it already, as many as may";
};

TEST_F(HeldWire, OneThatSleepsIsLetGoAndComesBack) {
  const auto holder = opened(BoardRole::control);
  asio::io_context asleep;
  const auto sleeper = program(BoardRole::watch, asleep);
  sleeper->carrier->open(sleeper->heard);
  in_time([&] {
    run_for(asleep, 1ms);
    return sleeper->carrier->up();
  });
  const FileDescriptor raw_sleeper = raw_watcher();
  const auto awake = opened(BoardRole::watch);
  int sent = 0;
  const auto until = Clock::now() + 1500ms;
  while (Clock::now() < until) {
    device.deliver(fmt::format("state {};{}", ++sent, std::string(160, 'x')));
    run_for(io, 2ms);
  }
  EXPECT_EQ(awake->heard.datagrams.size(), static_cast<std::size_t>(sent));
  // What waits in the kernel, and then the end.
  std::array<char, 2048> bytes;
  int old = 0;
  ssize_t last = 0;
  while ((last = receive_packet(raw_sleeper.get(), bytes.data(), bytes.size())) > 0) ++old;
  EXPECT_LT(old, 200);
  EXPECT_EQ(last, 0) << "still there";
  ASSERT_TRUE(in_time([&] {
    device.deliver("again");
    run_for(asleep, 5ms);
    return sleeper->has("again");
  }));
}

TEST_F(HeldWire, WhoSaysWhatNoProgramOfOursDoesIsRefused) {
  const auto holder = opened(BoardRole::control);
  const std::string not_a_stop = "who watches may say nothing to the board but a stop";
  const std::string no_message = "what was said to it is no message";
  struct Case {
    Letter kind;
    std::string text;
    std::string reason;
  };
  for (const auto& [kind, text, reason] : {
           Case{Letter::received, "SAFE:0;", not_a_stop},
           Case{Letter::sent, "O:358,1,1;", not_a_stop},
           Case{Letter::stop, "no datagram", not_a_stop},
           Case{Letter::stop, datagram_of("O", "358,1,1"), not_a_stop},
           Case{Letter::stop, datagram_of("E", "CLEAR"), not_a_stop},
           Case{Letter::stop, datagram_of("E", "LEAVE"), not_a_stop},
           Case{Letter::stop, datagram_of("H", "ROS2-R4"), not_a_stop},
           Case{Letter::yours, "", not_a_stop},
           Case{Letter::up, "device:", not_a_stop},
           Case{static_cast<Letter>('?'), "?", no_message},
           Case{Letter::stop, std::string(max_datagram + 1, 'x'), no_message},
           Case{Letter::stop, std::string(3000, 'x'), no_message},
           Case{Letter::hello, "2w", no_message},
       }) {
    const FileDescriptor connection = raw();
    ASSERT_EQ(send_message(connection.get(), kind, text), 0);
    EXPECT_EQ(refusal(connection), reason) << static_cast<char>(kind) << text.substr(0, 20);
  }
  const FileDescriptor twice = raw_watcher();
  send_message(twice.get(), Letter::hello, hello_text(BoardRole::control, "raw"));
  EXPECT_EQ(refusal(twice), not_a_stop);
  const FileDescriptor other_version = raw();
  send_message(other_version.get(), Letter::hello, "9");
  EXPECT_EQ(last_words(other_version).value().back().substr(0, 2), "w2");
  EXPECT_TRUE(device.all_sent().empty());
  EXPECT_TRUE(holder->heard.datagrams.empty());
  EXPECT_TRUE(holder->carrier->up());
}

// It has not read all that was sent when it ends the connection.
TEST_F(HeldWire, ARefusalIsHeardByWhoSaysMoreThanIsRead) {
  const auto holder = opened(BoardRole::control);
  const FileDescriptor connection = raw();
  for (int i = 0; i < 5; ++i) send_message(connection.get(), Letter::yours, {});
  EXPECT_EQ(refusal(connection), "who watches may say nothing to the board but a stop");
}

TEST_F(HeldWire, AFloodOfStopsEndsAtAHundredASecond) {
  const auto holder = opened(BoardRole::control);
  const FileDescriptor connection = raw();
  in_time([&] {
    const int error = send_message(connection.get(), Letter::stop, stop);
    return error != 0 && error != EAGAIN;
  });
  EXPECT_GE(device.all_sent().size(), 1U);
  EXPECT_LE(device.all_sent().size(), 202U);
}

TEST_F(HeldWire, TheLastWordOfOneThatSaysTooMuchMayBeAStop) {
  const auto holder = opened(BoardRole::control);
  const FileDescriptor connection = raw_watcher();
  for (int i = 0; i < 100; ++i) {
    ASSERT_TRUE(in_time([&] { return send_message(connection.get(), Letter::stop, stop) == 0; }));
  }
  EXPECT_EQ(refusal(connection), "it was told more than 100 things in a second");
  EXPECT_EQ(device.all_sent().size(), 100U);
}

TEST_F(HeldWire, ASeventeenthIsToldWhyAndGetsAPlaceThatBecomesFree) {
  const auto holder = opened(BoardRole::control);
  std::vector<FileDescriptor> sharers = raw_watchers(16);
  const auto one_too_many = program(BoardRole::watch, io);
  one_too_many->carrier->open(one_too_many->heard);
  ASSERT_TRUE(run_until(io, [&] { return one_too_many->heard.count(Kind::down) == 1; }));
  EXPECT_EQ(one_too_many->heard.last(Kind::down)->problem.text(),
            "device:: " + full + "; end one of them; its place is free at once");
  run_for(io, 1500ms);  // it comes again, and is told the same
  EXPECT_EQ(one_too_many->heard.count(Kind::down), 1U);
  device.deliver("not for it");
  sharers.pop_back();
  ASSERT_TRUE(run_until(io, [&] { return one_too_many->carrier->up(); }));
  device.deliver("state");
  EXPECT_TRUE(run_until(io, [&] { return one_too_many->has("state"); }));
  EXPECT_FALSE(one_too_many->has("not for it"));
}

TEST_F(HeldWire, ASeventeenthStopsTheBoardAndHearsThatItHasObeyed) {
  const auto holder = opened(BoardRole::control);
  const auto sharers = raw_watchers(16);
  // As r4 stop does, which goes on until it hears that.
  const auto stopper = program(BoardRole::watch, io);
  stopper->carrier->open(stopper->heard);
  EXPECT_EQ(stopper->carrier->send(stop, Priority::stop), SendResult::sent);
  ASSERT_TRUE(run_until(io, [&] { return stopper->carrier->up(); }));
  EXPECT_EQ(device.all_sent(), std::vector<std::string>{stop});
  device.deliver("SAFE:2;");
  EXPECT_TRUE(run_until(io, [&] { return stopper->has("SAFE:2;"); }));
  // When it was told that there is no place, too.
  const auto late = program(BoardRole::watch, io);
  late->carrier->open(late->heard);
  ASSERT_TRUE(run_until(io, [&] { return late->heard.count(Kind::down) == 1; }));
  EXPECT_EQ(late->carrier->send(stop, Priority::stop), SendResult::sent);
  ASSERT_TRUE(run_until(io, [&] { return late->carrier->up(); }));
  EXPECT_EQ(device.all_sent().size(), 2U);
}

TEST_F(HeldWire, AStopIsObeyedWhateverPlacesAreTaken) {
  const auto holder = opened(BoardRole::control);
  const auto sharers = raw_watchers(16);
  std::vector<FileDescriptor> stoppers;
  for (std::size_t i = 1; i <= 10; ++i) {
    stoppers.push_back(raw_watcher());
    run_for(io, 5ms);
    EXPECT_EQ(send_message(stoppers.back().get(), Letter::stop, stop), 0);
    ASSERT_TRUE(run_until(io, [&] { return device.all_sent().size() == i; })) << i;
  }
}

TEST_F(HeldWire, ASeventeenthTakesTheWireToControlTheBoard) {
  OtherThread elsewhere;
  std::unique_ptr<Program> watcher;
  elsewhere.run([&] {
    watcher = program(BoardRole::watch, elsewhere.loop);
    watcher->carrier->open(watcher->heard);
  });
  const auto sharers = raw_watchers(16);
  std::vector<FileDescriptor> idle;
  for (int i = 0; i < 20; ++i) idle.push_back(raw());
  const auto driver = program(BoardRole::control, io);
  driver->carrier->open(driver->heard);
  EXPECT_TRUE(driver->carrier->up());
  elsewhere.run([&] { watcher.reset(); });
}

TEST_F(HeldWire, WhoSaysNothingKeepsNobodyAway) {
  const auto holder = opened(BoardRole::control);
  std::vector<FileDescriptor> idle;
  const auto began = Clock::now();
  for (int i = 0; i < 30; ++i) idle.push_back(raw());
  const auto watcher = opened(BoardRole::watch);
  const std::string reason = "the program that came to share it said nothing";
  EXPECT_EQ(refusal(idle.front()), reason);
  EXPECT_LT(in_milliseconds(Clock::now() - began), 1000) << "those who came later need its place";
  EXPECT_EQ(refusal(idle.back()), reason);
  EXPECT_GE(in_milliseconds(Clock::now() - began), 1000) << "it has a second";
  EXPECT_TRUE(watcher->carrier->up());
}

TEST_F(HeldWire, AStopWithoutAHelloIsObeyedAlsoOfOneThatMustGo) {
  const auto holder = opened(BoardRole::control);
  std::vector<FileDescriptor> idle;
  for (int i = 0; i < 8; ++i) idle.push_back(raw());
  run_for(io, 20ms);
  EXPECT_EQ(send_message(idle.front().get(), Letter::stop, stop), 0);
  idle.push_back(raw());
  ASSERT_TRUE(run_until(io, [&] { return !device.all_sent().empty(); }));
  run_for(io, 20ms);
  EXPECT_EQ(device.all_sent(), std::vector<std::string>{stop});
}

TEST_F(HeldWire, StrangersAreTurnedAwayOneATurnOfTheLoopAndFewAtATime) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can be a stranger, too";
  const auto holder = opened(BoardRole::control);
  std::vector<FileDescriptor> strangers;
  while (strangers.size() < 100) strangers.push_back(stranger());
  const auto turned_away = [&] {
    return std::count_if(strangers.begin(), strangers.end(), is_ended);
  };
  const auto began = Clock::now();
  while (turned_away() == 0 && Clock::now() - began < patience) {
    io.restart();
    io.run_one_for(1ms);
  }
  EXPECT_EQ(turned_away(), 1) << "the loop does other things in between";
  ASSERT_TRUE(run_until(io, [&] { return turned_away() == 100; }));
  // Sixteen in each window; the first window may be over in no time.
  EXPECT_GE(Clock::now() - began, 5 * WireHolder::arrival_window);
}

TEST_F(HeldWire, AProgramThatFindsManyWaitingWaitsForItsTurn) {
  const auto holder = opened(BoardRole::control);
  std::vector<FileDescriptor> waiting;
  while (FileDescriptor one = reach_holder({wire}).connection) waiting.push_back(std::move(one));
  EXPECT_GE(waiting.size(), 100U);
  OtherThread elsewhere;
  const auto watcher = program(BoardRole::watch, elsewhere.loop);
  std::promise<void> opened;
  auto is_open = opened.get_future();
  asio::post(elsewhere.loop, [&] {
    watcher->carrier->open(watcher->heard);
    opened.set_value();
  });
  EXPECT_TRUE(in_time([&] { return is_open.wait_for(0s) == std::future_status::ready; }));
  bool is_shared = false;
  elsewhere.run([&] {
    is_shared = watcher->carrier->is_shared();
    watcher->carrier->close();
  });
  EXPECT_TRUE(is_shared);
}

// What the system refuses ends nothing: the program may be driving.
TEST_F(HeldWire, AProgramForWhichTheLoopCannotWaitIsLetGoAndTheHolderGoesOn) {
  in_a_thread_of_its_own([&] {
    const auto holder = opened(BoardRole::control);
    const auto watcher = opened(BoardRole::watch);
    refuse(no_watches);
    const FileDescriptor late = raw();
    EXPECT_TRUE(in_time([&] { return is_ended(late); }));
    device.deliver("state");
    EXPECT_TRUE(run_until(io, [&] { return watcher->has("state"); }));
    EXPECT_TRUE(holder->has("state"));
    const auto told = program(BoardRole::watch, io);
    try {
      told->carrier->open(told->heard);
      ADD_FAILURE() << "it cannot wait for the holder";
    } catch (const Error& error) {
      EXPECT_NE(error.problem().reason.find("wait for as many files"), std::string::npos);
    }
  });
}

}  // namespace
}  // namespace r4::test
