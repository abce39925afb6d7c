// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>

#include "shared_wire.hpp"
#include "tests/support/datagrams.hpp"
#include "transports/share/share_message.hpp"
#include "transports/share/share_socket.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;

class SharedCarrier : public SharedWireTest {};

TEST_F(SharedCarrier, WhoComesFirstHasTheWire) {
  const auto only = opened(BoardRole::control);
  EXPECT_EQ(device.opened, 1);
  EXPECT_EQ(only->carrier->name(), "device:");
  EXPECT_EQ(only->carrier->send("hello", Priority::normal), SendResult::sent);
  EXPECT_EQ(device.all_sent(), std::vector<std::string>{"hello"});
  device.deliver("answer");
  EXPECT_TRUE(run_until(io, [&] { return only->has("answer"); }));
  only->carrier->close();
  EXPECT_EQ(device.open, nullptr);
  EXPECT_FALSE(reach_holder({wire}).connection);
}

TEST_F(SharedCarrier, ThoseThatWatchHearBothDirections) {
  const auto driver = opened(BoardRole::control);
  const auto one = opened(BoardRole::watch);
  const auto two = opened(BoardRole::watch);
  EXPECT_EQ(device.opened, 1);
  EXPECT_EQ(one->carrier->name(), "device:");
  for (int i = 0; i < 100; ++i) {
    device.deliver(fmt::format("AIN24:{};", i));
    device.deliver(fmt::format("H:R4-ROS2;{};", i));
    driver->carrier->send(fmt::format("H:ROS2-R4;{};", i), Priority::normal);
    run_until(io, [&] { return two->has(fmt::format("H:R4-ROS2;{};", i)); });
  }
  for (const auto& each : {one.get(), two.get()}) {
    ASSERT_TRUE(run_until(io, [&] { return each->heard.overheard.size() == 100; }));
    EXPECT_EQ(each->heard.datagrams.size(), 200U);
    EXPECT_EQ(each->heard.overheard.back(), "H:ROS2-R4;99;");
    EXPECT_EQ(each->carrier->counters().rx_datagrams, 200U);
    EXPECT_GT(each->heard.drained, 0);
  }
  EXPECT_TRUE(driver->heard.overheard.empty());
}

TEST_F(SharedCarrier, ThoseThatWatchHearNoSecret) {
  const auto driver = opened(BoardRole::control);
  const auto watcher = opened(BoardRole::watch);
  const std::string setting = with_crc("C:password,letmein!;PNum:1;T:2;");
  const std::string masked = with_crc("C:password,...;PNum:1;T:2;");
  driver->carrier->send(setting, Priority::normal);
  device.overhear(setting);
  device.deliver(setting);  // an echo of the line
  ASSERT_TRUE(run_until(io, [&] { return watcher->has(masked); }));
  EXPECT_EQ(watcher->heard.overheard, (std::vector<std::string>{masked, masked}));
  ASSERT_EQ(watcher->heard.datagrams.size(), 1U);
  EXPECT_EQ(device.all_sent(), std::vector<std::string>{setting}) << "to the board as it is";
}

// Whoever drives is kept waiting by nobody that watches.
TEST_F(SharedCarrier, WhoHoldsTheWireHasWhatComesAndSendsWhatGoesBeforeOthersAreTold) {
  const auto driver = opened(BoardRole::control);
  const FileDescriptor watcher = reach_holder({wire}).connection;
  send_message(watcher.get(), ShareMessage::Kind::hello, hello_text(BoardRole::watch, "watcher"));
  std::array<char, ShareMessage::max_size> packet;
  const auto hear = [&] { return receive_packet(watcher.get(), packet.data(), packet.size()) > 0; };
  for (int answers = 0; answers < 2;) {  // welcome, up
    run_for(io, 1ms);
    answers += hear() ? 1 : 0;
  }
  int before = 0;
  const auto look = [&] { before += hear() ? 0 : 1; };
  driver->heard.then = [&](const auto&) { look(); };
  device.then_sent = look;
  device.deliver("state");
  ASSERT_TRUE(run_until(io, [&] { return before == 1; }));
  EXPECT_TRUE(hear());
  driver->carrier->send("O:358,1,1;", Priority::normal);
  EXPECT_EQ(before, 2);
  EXPECT_TRUE(hear());
}

TEST_F(SharedCarrier, AllHearWhatAnotherHostSaysOnTheWireAndWhatIsTooLong) {
  const auto driver = opened(BoardRole::control);
  const auto watcher = opened(BoardRole::watch);
  device.overhear("O:358,1,1;");
  device.deliver(std::string(2000, 'x'));
  device.deliver("last");
  ASSERT_TRUE(run_until(io, [&] { return watcher->has("last"); }));
  for (const auto& each : {driver.get(), watcher.get()}) {
    EXPECT_EQ(each->heard.overheard, std::vector<std::string>{"O:358,1,1;"});
    EXPECT_EQ(each->heard.oversize, std::vector<std::string>{std::string(max_datagram, 'x')});
  }
  EXPECT_EQ(watcher->carrier->counters().rx_oversize, 1U);
}

TEST_F(SharedCarrier, WhoWatchesStopsTheBoardAndSaysNothingElse) {
  const auto driver = opened(BoardRole::control);
  const auto watcher = opened(BoardRole::watch);
  EXPECT_TRUE(watcher->carrier->is_shared());
  EXPECT_FALSE(driver->carrier->is_shared());
  watcher->carrier->send(datagram_of("H", "ROS2-R4"), Priority::normal);
  const std::string stop = datagram_of("E", "STOP");
  EXPECT_EQ(watcher->carrier->send(stop, Priority::stop), SendResult::sent);
  ASSERT_TRUE(run_until(io, [&] { return !device.all_sent().empty(); }));
  EXPECT_EQ(device.all_sent(), std::vector<std::string>{stop});
  EXPECT_EQ(driver->heard.overheard, std::vector<std::string>{stop});
}

TEST_F(SharedCarrier, AStopNeedsNoWelcome) {
  const auto driver = opened(BoardRole::control);
  const auto watcher = program(BoardRole::watch, io);
  watcher->carrier->open(watcher->heard);
  const std::string stop = datagram_of("E", "STOP");
  EXPECT_EQ(watcher->carrier->send(stop, Priority::stop), SendResult::sent);
  watcher->carrier->close();
  EXPECT_TRUE(run_until(io, [&] { return !device.all_sent().empty(); }));
}

TEST_F(SharedCarrier, AThirdIsToldWhoControls) {
  OtherThread elsewhere;
  std::unique_ptr<Program> driver;
  elsewhere.run([&] {
    driver = program(BoardRole::control, elsewhere.loop);
    driver->carrier->open(driver->heard);
  });
  const auto second = program(BoardRole::control, io);
  const auto error = error_of([&] { second->carrier->open(second->heard); });
  ASSERT_TRUE(error);
  EXPECT_EQ(error->kind(), ErrorKind::refused);
  EXPECT_EQ(error->problem().reason,
            fmt::format("controlled by {} (pid {})", program_invocation_short_name, ::getpid()));
  EXPECT_FALSE(second->carrier->up());
  EXPECT_EQ(device.opened, 1);
  elsewhere.run([&] { driver.reset(); });
  second->carrier->open(second->heard);
  EXPECT_TRUE(second->carrier->up());
}

TEST_F(SharedCarrier, WhoWatchesGivesTheWireToWhoControls) {
  OtherThread elsewhere;
  std::array<std::unique_ptr<Program>, 3> watchers;
  elsewhere.run([&] {
    for (auto& each : watchers) {
      each = program(BoardRole::watch, elsewhere.loop);
      each->carrier->open(each->heard);
    }
  });
  EXPECT_EQ(device.opened, 1);
  const auto driver = program(BoardRole::control, io);
  driver->carrier->open(driver->heard);
  EXPECT_TRUE(driver->carrier->up());
  driver->carrier->send("O:358,1,1;", Priority::normal);
  const auto all_hear = [&](const std::string& text) {
    return in_time([&] {
      device.deliver(text);
      run_for(io, 5ms);
      bool all = true;
      elsewhere.run([&] {
        for (const auto& each : watchers) all = all && each->has(text);
      });
      return all;
    });
  };
  EXPECT_TRUE(all_hear("driven"));
  driver->carrier->close();
  ASSERT_TRUE(in_time([&] {
    const std::lock_guard lock(device.mutex);
    return device.open != nullptr;
  }));
  EXPECT_TRUE(all_hear("nobody drives"));
  elsewhere.run([&] {
    for (auto& each : watchers) {
      EXPECT_EQ(each->heard.count(Kind::down), 0U);
      each.reset();
    }
  });
}

TEST_F(SharedCarrier, AnotherTakesTheWireOverFromOneThatEnds) {
  std::vector<std::unique_ptr<Program>> programs;
  for (int i = 0; i < 5; ++i) programs.push_back(opened(BoardRole::watch));
  while (programs.size() > 1) {
    programs.erase(programs.begin());
    const auto ended = Clock::now();
    // Whoever has it now.
    ASSERT_TRUE(run_until(io, [&] { return device.open != nullptr; }));
    EXPECT_LT(in_milliseconds(Clock::now() - ended), 100);
    const std::string text = fmt::format("{} left", programs.size());
    ASSERT_TRUE(in_time([&] {
      device.deliver(text);
      run_for(io, 5ms);
      bool all = true;
      for (const auto& each : programs) all = all && each->has(text);
      return all;
    }));
  }
  EXPECT_EQ(device.opened, 5);
  EXPECT_EQ(programs.front()->heard.count(Kind::down), 0U);
  EXPECT_GE(programs.front()->carrier->counters().rx_datagrams, 3U) << "heard of four others";
}

TEST_F(SharedCarrier, TroubleOfTheWireIsToldToAll) {
  const auto holder = opened(BoardRole::watch);
  const auto early = opened(BoardRole::watch);
  const Problem unplugged{ErrorKind::open, "device:", "unplugged", "plug it in again"};
  device.report({CarrierEvent::Kind::down, unplugged});
  ASSERT_TRUE(run_until(io, [&] { return early->heard.count(Kind::down) == 1; }));
  EXPECT_EQ(early->heard.last(Kind::down)->problem.text(), unplugged.text());
  EXPECT_FALSE(early->carrier->up());
  const auto late = program(BoardRole::watch, io);
  late->carrier->open(late->heard);
  ASSERT_TRUE(run_until(io, [&] { return late->heard.count(Kind::down) == 1; }));
  device.report({CarrierEvent::Kind::up, Problem{ErrorKind::open, "device:", "", ""}});
  ASSERT_TRUE(run_until(io, [&] { return late->carrier->up() && early->carrier->up(); }));
  EXPECT_EQ(early->carrier->counters().downs, 1U);
  EXPECT_EQ(early->carrier->counters().ups, 2U);
  EXPECT_EQ(late->carrier->counters().downs, 0U) << "it was down when it came";
}

TEST_F(SharedCarrier, AsksAgainWhereAnotherOpensTheWireInBetween) {
  OtherThread elsewhere;
  // It meets at the next place, as one does for which the holder of the first hangs.
  auto rival = program(BoardRole::watch, elsewhere.loop, at_place({wire}, 1).name);
  device.before_open = [&] { elsewhere.run([&] { rival->carrier->open(rival->heard); }); };
  const auto driver = program(BoardRole::control, io);
  driver->carrier->open(driver->heard);
  EXPECT_TRUE(driver->carrier->up());
  EXPECT_EQ(device.opened, 2);
  elsewhere.run([&] { rival.reset(); });  // what it has under way there is its loop's
}

TEST_F(SharedCarrier, LooksAgainSlowlyWhereTheHolderEndsWhatItBegins) {
  const FileDescriptor unkind = hold_wire({wire});
  const auto watcher = program(BoardRole::watch, io);
  watcher->carrier->open(watcher->heard);
  int came = 0;
  const auto until = Clock::now() + 800ms;
  while (Clock::now() < until) {
    while (accept_sharer(unkind.get())) ++came;
    run_for(io, 1ms);
  }
  EXPECT_GE(came, 5);
  EXPECT_LE(came, 30);
  ASSERT_EQ(watcher->heard.count(Kind::down), 1U);
  EXPECT_EQ(watcher->heard.last(Kind::down)->problem.reason,
            fmt::format("the program that holds it (pid {}) does not share it", ::getpid()));
}

TEST_F(SharedCarrier, MayBeClosedByWhoHearsAStopOfAnother) {
  const auto driver = opened(BoardRole::control);
  const auto watcher = opened(BoardRole::watch);
  driver->heard.then_overheard = [&] { driver->carrier->close(); };
  const std::string stop = datagram_of("E", "STOP");
  for (int i = 0; i < 3; ++i) watcher->carrier->send(stop, Priority::stop);
  ASSERT_TRUE(run_until(io, [&] { return watcher->carrier->up() && device.opened == 2; }));
  EXPECT_EQ(device.all_sent(), std::vector<std::string>{stop});
}

TEST_F(SharedCarrier, IsNotForOtherUsers) {
  const auto holder = opened(BoardRole::control);
  const int result = run_unprivileged([&] { return reach_holder({wire}).connection ? 1 : 0; });
  EXPECT_EQ(result, 0);
}

TEST_F(SharedCarrier, IsForTheMembersOfTheGroupThatTheHolderNames) {
  const std::string stop = datagram_of("E", "STOP");
  // A user in the group nobody has (65534), and in no other.
  const auto stop_it = [&](const ShareGroup& of) {
    return run_unprivileged([&] {
      const SharedWire shared{wire, of};
      const FileDescriptor connection = reach_holder(shared).connection;
      if (!connection || !is_one_of_us(connection.get(), shared)) return 1;
      return send_message(connection.get(), ShareMessage::Kind::stop, stop);
    });
  };
  group = {"members", 65534};
  const auto holder = opened(BoardRole::control);
  EXPECT_NE(stop_it({"others", 65534}), 0) << "another name";
  EXPECT_EQ(stop_it(group), 0);
  EXPECT_TRUE(run_until(io, [&] { return !device.all_sent().empty(); }));
  EXPECT_EQ(device.all_sent(), std::vector<std::string>{stop});
  holder->carrier->close();
  group.id = 0;
  const auto strict = opened(BoardRole::control);
  stop_it(group);
  run_for(io, 20ms);
  EXPECT_EQ(device.all_sent().size(), 1U);
}

// Anyone may take a name: it must keep nobody from a wire, and be told where it matters.
TEST_F(SharedCarrier, AStrangerWhoTakesNamesKeepsNobodyFromTheWire) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can be a stranger, too";
  std::vector<FileDescriptor> squatters;
  const auto take = [&](int place) {
    const std::string name = "r4link/0/" + at_place({wire}, place).name;
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    name.copy(address.sun_path + 1, name.size());
    const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
    ASSERT_EQ(::seteuid(65534), 0);
    const int squatter =
        squatters.emplace_back(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0)).get();
    const bool taken = ::bind(squatter, reinterpret_cast<const sockaddr*>(&address), size) == 0 &&
                       ::listen(squatter, 1) == 0;
    ASSERT_EQ(::seteuid(0), 0);
    ASSERT_TRUE(taken);
  };
  take(0);
  {
    const auto driver = opened(BoardRole::control);
    const auto watcher = opened(BoardRole::watch);
    EXPECT_TRUE(watcher->carrier->is_shared());
    for (const auto& each : {driver.get(), watcher.get()})
      EXPECT_EQ(each->heard.count(Kind::warning), 0U);
  }
  for (int place = 1; place < share_places; ++place) take(place);
  const auto alone = opened(BoardRole::control);
  EXPECT_EQ(alone->carrier->send("hello", Priority::normal), SendResult::sent);
  EXPECT_EQ(device.all_sent(), std::vector<std::string>{"hello"});
  const auto& warning = alone->heard.events.back();
  EXPECT_EQ(warning.kind, CarrierEvent::Kind::warning);
  EXPECT_EQ(warning.problem.kind, ErrorKind::permission);
  EXPECT_EQ(
      warning.problem.reason,
      fmt::format("user 65534 (pid {}) has taken the names by which programs of user 0 share it",
                  ::getpid()));
}

}  // namespace
}  // namespace r4::test
