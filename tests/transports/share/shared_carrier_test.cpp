// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>

#include "shared_transport.hpp"
#include "tests/support/datagrams.hpp"
#include "tests/support/problems.hpp"
#include "transports/share/share_message.hpp"
#include "transports/share/share_socket.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;

class SharedCarrier : public SharedTransportTest {
 protected:
  const Problem unplugged{ErrorKind::open, "device:", "unplugged", "plug it in again"};
  const std::string silent =
      fmt::format("the program that has it open (pid {}) does not answer", ::getpid());
};

TEST_F(SharedCarrier, WatchersHearBothDirections) {
  const auto driver = opened(BoardRole::control);
  const auto one = opened(BoardRole::watch);
  const auto two = opened(BoardRole::watch);
  EXPECT_EQ(device.opened, 1);
  EXPECT_EQ(one->carrier->name(), "device:");
  for (int i = 0; i < 100; ++i) {
    device.deliver(fmt::format("AIN24:{};", i));
    device.deliver(fmt::format("H:R4-ROS2;{};", i));
    driver->carrier->send(fmt::format("H:ROS2-R4;{};", i), Priority::normal);
    ASSERT_TRUE(run_until(io, [&] { return two->has(fmt::format("H:R4-ROS2;{};", i)); }));
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

TEST_F(SharedCarrier, WatchersHearNoSecret) {
  const auto driver = opened(BoardRole::control);
  const auto watcher = opened(BoardRole::watch);
  const std::string setting = with_crc("C:password,letmein!;PNum:1;T:2;");
  const std::string masked = with_crc("C:password,...;PNum:1;T:2;");
  driver->carrier->send(setting, Priority::normal);
  device.overhear(setting);
  device.deliver(setting);  // an echo of the line
  ASSERT_TRUE(run_until(io, [&] { return watcher->has(masked); }));
  EXPECT_EQ(watcher->heard.overheard, (std::vector<std::string>{masked, masked}));
  EXPECT_EQ(device.sent, std::vector<std::string>{setting})
      << "the board receives the secret unchanged";
}

TEST_F(SharedCarrier, ServesItsOwnProgramBeforeOthers) {
  const auto driver = opened(BoardRole::control);
  const FileDescriptor watcher = connect_to_holder(share, BoardRole::control);
  send_message(watcher.get(), ShareMessage::Kind::hello, ShareMessage::version);
  std::array<char, ShareMessage::max_size> packet;
  const auto hear = [&] {
    return ::recv(watcher.get(), packet.data(), packet.size(), MSG_TRUNC) > 0;
  };
  for (int answers = 0; answers < 2;) {  // one answer is welcome, the other is up
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

TEST_F(SharedCarrier, EveryProgramHearsOtherHostsAndTooLongDatagrams) {
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

TEST_F(SharedCarrier, AWatcherMayStopTheBoardAtOnceAndSendNothingElse) {
  const auto driver = opened(BoardRole::control);
  const auto watcher = opened_in(io, BoardRole::watch);  // the holder does not serve it yet
  EXPECT_TRUE(watcher->carrier->is_shared());
  EXPECT_FALSE(driver->carrier->is_shared());
  EXPECT_EQ(watcher->carrier->send(datagram_of("H", "ROS2-R4"), Priority::normal),
            SendResult::down);
  EXPECT_EQ(watcher->carrier->send(stop, Priority::stop), SendResult::sent);
  watcher->carrier->close();
  ASSERT_TRUE(run_until(io, [&] { return !device.sent.empty(); }));
  EXPECT_EQ(device.sent, std::vector<std::string>{stop});
  EXPECT_EQ(driver->heard.overheard, std::vector<std::string>{stop});
}

TEST_F(SharedCarrier, RefusesASecondControllingProgramAndNamesTheFirst) {
  auto driver = opened(BoardRole::control);
  const auto second = program(BoardRole::control, io);
  const Problem problem = problem_of([&] { second->open(); });
  EXPECT_EQ(problem.kind, ErrorKind::refused);
  EXPECT_EQ(problem.reason,
            fmt::format("controlled by {} (pid {})", program_of(::getpid()), ::getpid()));
  ASSERT_TRUE(problem.holder);
  EXPECT_EQ(problem.holder->pid, ::getpid());
  EXPECT_EQ(problem.holder->name, program_of(::getpid()));
  EXPECT_FALSE(second->carrier->up());
  EXPECT_EQ(device.opened, 1);
  driver.reset();
  second->open();
  EXPECT_TRUE(second->carrier->up());
}

TEST_F(SharedCarrier, WatchersYieldTheTransportToAControllingProgram) {
  const auto one = opened(BoardRole::watch);
  const auto two = opened(BoardRole::watch);
  const auto driver = opened_in(io, BoardRole::control);
  EXPECT_FALSE(driver->carrier->up()) << "open() does not wait for the holder";
  ASSERT_TRUE(run_until(io, [&] { return driver->carrier->up(); }));
  EXPECT_TRUE(all_hear("driven", one, two, driver));
  EXPECT_TRUE(one->carrier->is_shared());
  EXPECT_TRUE(two->carrier->is_shared());
  driver->carrier->close();
  EXPECT_TRUE(all_hear("nobody drives", one, two));
  EXPECT_EQ(device.opened, 3);
  for (const auto& each : {one.get(), two.get()}) EXPECT_EQ(each->heard.count(Kind::down), 0U);
}

TEST_F(SharedCarrier, AWatcherMayTakeAndReleaseControl) {
  const auto one = opened(BoardRole::watch);
  const auto two = opened(BoardRole::watch);
  for (const auto* each : {two.get(), one.get()}) {  // first a served program, then the holder
    each->carrier->change_role(BoardRole::control);
    EXPECT_TRUE(error_of([&] { program(BoardRole::control, io)->open(); }))
        << "control changes at once";
    EXPECT_TRUE(all_hear("driven", one, two));
    EXPECT_FALSE(each->carrier->is_shared());
    EXPECT_EQ(each->carrier->send("hello", Priority::normal), SendResult::sent);
    one->heard.datagrams.clear();
    two->heard.datagrams.clear();
    each->carrier->change_role(BoardRole::watch);
    EXPECT_FALSE(connect_to_holder(share, BoardRole::control));
    EXPECT_TRUE(all_hear("nobody drives", one, two));
    EXPECT_EQ(each->heard.count(Kind::down), 0U);
    each->carrier->change_role(BoardRole::watch);
    EXPECT_TRUE(each->carrier->up()) << "the role did not change";
  }
  EXPECT_EQ(device.sent.size(), 2U);
}

TEST_F(SharedCarrier, AWatcherThatIsRefusedControlKeepsWatching) {
  const auto driver = opened(BoardRole::control);
  const auto watcher = opened(BoardRole::watch);
  const Problem problem = problem_of([&] { watcher->carrier->change_role(BoardRole::control); });
  ASSERT_TRUE(problem.holder);
  EXPECT_EQ(problem.holder->pid, ::getpid());
  EXPECT_TRUE(all_hear("watched", watcher));
  EXPECT_EQ(device.opened, 1);
  EXPECT_TRUE(watcher->carrier->is_shared());
  driver->carrier->change_role(BoardRole::watch);
  watcher->carrier->change_role(BoardRole::control);
  EXPECT_TRUE(all_hear("driven", driver, watcher));
  EXPECT_TRUE(driver->carrier->is_shared());
}

TEST_F(SharedCarrier, ChangesItsRoleInAnyCallback) {
  const auto one = opened(BoardRole::watch);
  const auto two = opened(BoardRole::watch);
  // First the holder, then the program that it serves.
  for (Program* const each : {one.get(), two.get()}) {
    bool changed = false;
    const auto role = [&](BoardRole wanted) {
      changed = false;
      each->heard.then = [&, wanted](const auto&) {
        if (!std::exchange(changed, true)) each->carrier->change_role(wanted);
      };
    };
    role(BoardRole::control);
    EXPECT_TRUE(all_hear("a", one, two));
    EXPECT_TRUE(
        in_time([&] { return each->carrier->send("b", Priority::normal) == SendResult::sent; }));
    role(BoardRole::watch);
    one->heard.datagrams.clear();
    two->heard.datagrams.clear();
    EXPECT_TRUE(all_hear("c", one, two));
    EXPECT_FALSE(connect_to_holder(share, BoardRole::control));
    each->heard.then = nullptr;
  }
}

TEST_F(SharedCarrier, AnotherProgramBecomesHolderWhenTheHolderEnds) {
  std::vector<std::unique_ptr<Program>> programs;
  for (int i = 0; i < 4; ++i) programs.push_back(opened(BoardRole::watch));
  while (programs.size() > 1) {
    programs.erase(programs.begin());
    EXPECT_TRUE(
        all_hear(fmt::format("{} left", programs.size()), programs.front(), programs.back()));
  }
  EXPECT_EQ(device.opened, 4);
  EXPECT_EQ(programs.front()->heard.count(Kind::down), 0U);
  EXPECT_GE(programs.front()->carrier->counters().rx_datagrams, 2U)
      << "includes datagrams from earlier holders";
}

TEST_F(SharedCarrier, ReportsEventsOfTheTransportToAllPrograms) {
  const auto holder = opened(BoardRole::watch);
  const auto early = opened(BoardRole::watch);
  device.report({Kind::down, unplugged});
  ASSERT_TRUE(run_until(io, [&] { return early->heard.count(Kind::down) == 1; }));
  EXPECT_EQ(early->heard.last(Kind::down)->problem.text(), unplugged.text());
  EXPECT_FALSE(early->carrier->up());
  const auto late = opened_in(io, BoardRole::watch);
  ASSERT_TRUE(run_until(io, [&] { return late->heard.count(Kind::down) == 1; }));
  device.report({Kind::up, Problem{ErrorKind::open, "device:", "", ""}});
  ASSERT_TRUE(run_until(io, [&] { return late->carrier->up() && early->carrier->up(); }));
  EXPECT_EQ(early->carrier->counters().downs, 1U);
  EXPECT_EQ(early->carrier->counters().ups, 2U);
  EXPECT_EQ(late->carrier->counters().downs, 0U) << "the transport was down before it opened";
}

TEST_F(SharedCarrier, MayBeClosedInTheCallbackForAnOverheardStop) {
  const auto driver = opened(BoardRole::control);
  const auto watcher = opened(BoardRole::watch);
  driver->heard.then_overheard = [&] { driver->carrier->close(); };
  for (int i = 0; i < 3; ++i) watcher->carrier->send(stop, Priority::stop);
  ASSERT_TRUE(run_until(io, [&] { return watcher->carrier->up() && device.opened == 2; }));
  EXPECT_EQ(device.sent, std::vector<std::string>{stop});
}

// When a board with a symbolic link to a pty restarts, the symbolic link leads to a new device.
TEST_F(SharedCarrier, ReopensWhenADeviceNamedByItsPathIsUnplugged) {
  share.is_path = true;
  const auto one = opened(BoardRole::watch);
  const auto two = opened(BoardRole::watch);
  const ShareName before = share;
  share.text += "/elsewhere";
  device.report({Kind::down, unplugged});
  ASSERT_TRUE(run_until(io, [&] { return two->heard.count(Kind::down) == 1; }));
  EXPECT_TRUE(in_time([&] { return one->carrier->up() && two->carrier->up(); }));
  EXPECT_FALSE(connect_to_holder(before, BoardRole::watch)) << "another device may be at that path";
  EXPECT_TRUE(all_hear("to all", one, two));
  EXPECT_EQ(device.opened, 2);
  EXPECT_EQ(one->heard.count(Kind::down) + two->heard.count(Kind::down), 2U);
}

// --- a holder that does not answer

TEST_F(SharedCarrier, NamesASilentHolderIfTheTransportCannotBeOpened) {
  asio::io_context stopped;  // runs only in goes_on()
  const auto holder = opened_in(stopped, BoardRole::watch);
  const auto watcher = opened_in(io, BoardRole::watch);
  const auto driver = opened_in(io, BoardRole::control);
  for (const auto* each : {watcher.get(), driver.get()}) {
    ASSERT_TRUE(run_until(io, [&] { return each->heard.count(Kind::down) == 1; }));
    EXPECT_EQ(each->heard.last(Kind::down)->problem.reason, silent);
  }
  driver->carrier->close();
  const auto goes_on = [&] {
    return in_time([&] {
      run_for(stopped, 5ms);
      return watcher->carrier->up();
    });
  };
  ASSERT_TRUE(goes_on());
  // The holder stops again after it has served the watcher.
  ASSERT_TRUE(run_until(io, [&] { return watcher->heard.count(Kind::down) == 2; }));
  ASSERT_TRUE(goes_on());
  EXPECT_EQ(watcher->heard.count(Kind::down), 2U);
}

TEST_F(SharedCarrier, IsOpenedNextToASilentHolder) {
  device.exclusive = false;
  asio::io_context hanging;
  const auto holder = opened_in(hanging, BoardRole::watch);
  const auto watcher = opened_in(io, BoardRole::watch);
  // A silent board does not mean that the holder hangs.
  EXPECT_FALSE(run_until(
      io,
      [&] {
        hanging.restart();
        hanging.poll();
        return device.opened != 1;
      },
      1500ms));
  EXPECT_TRUE(watcher->carrier->up());

  EXPECT_TRUE(run_until(io, [&] { return device.opened == 2; }));
  EXPECT_FALSE(watcher->carrier->is_shared());
  const auto driver = opened(BoardRole::control);
  const auto late = opened(BoardRole::watch);
  EXPECT_TRUE(late->carrier->is_shared()) << "the controlling program serves it";
  EXPECT_EQ(watcher->heard.count(Kind::down), 0U);
}

TEST_F(SharedCarrier, IsTakenFromASilentHolderThatOnlyWatches) {
  device.may_be_taken = true;
  asio::io_context hanging;
  const auto holder = opened_in(hanging, BoardRole::watch);
  const auto watcher = opened_in(io, BoardRole::watch);
  EXPECT_TRUE(all_hear("without it", watcher));
  const auto driver = opened(BoardRole::control);
  EXPECT_TRUE(all_hear("driven", watcher, driver));
  EXPECT_TRUE(watcher->carrier->is_shared());
  const auto driven_at = device.opened;
  EXPECT_FALSE(holder->has("driven"));
  // The holder runs again.
  ASSERT_TRUE(in_time([&] {
    run_for(hanging, 5ms);
    device.deliver("joined");
    return holder->has("joined");
  }));
  EXPECT_EQ(device.opened, driven_at);
  EXPECT_EQ(watcher->heard.count(Kind::down) + holder->heard.count(Kind::down), 0U);
}

TEST_F(SharedCarrier, StaysWithASilentHolderThatControls) {
  device.may_be_taken = true;
  asio::io_context hanging;
  const auto holder = opened_in(hanging, BoardRole::control);
  const auto second = program(BoardRole::control, io);
  EXPECT_EQ(problem_of([&] { second->open(); }).kind, ErrorKind::refused);
  const auto watcher = opened_in(io, BoardRole::watch);
  ASSERT_TRUE(run_until(io, [&] { return watcher->heard.count(Kind::down) == 1; }));
  EXPECT_EQ(watcher->heard.last(Kind::down)->problem.reason, silent);
  EXPECT_EQ(device.opened, 1);
}

TEST_F(SharedCarrier, IgnoresASuspendedHolderAtOnce) {
  const pid_t holder = ::fork();
  if (holder == 0) {
    const FileDescriptor name = take_share_name(share, BoardRole::watch);
    ::raise(SIGSTOP);
    ::_exit(0);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(holder, &status, WUNTRACED), holder);
  for (const BoardRole role : {BoardRole::watch, BoardRole::control}) {
    EXPECT_TRUE(opened_in(io, role)->carrier->up());
  }
  ::kill(holder, SIGKILL);
  ::waitpid(holder, &status, 0);
}

TEST_F(SharedCarrier, IgnoresAHolderWithAFullConnectionQueue) {
  device.exclusive = false;
  asio::io_context hanging;
  const auto holder = opened_in(hanging, BoardRole::watch);
  while (connect_to_holder(share, BoardRole::watch)) continue;
  for (const BoardRole role : {BoardRole::watch, BoardRole::control}) opened(role);
  EXPECT_EQ(device.opened, 3);
}

TEST_F(SharedCarrier, ReconnectsSlowlyIfTheHolderEndsTheConnection) {
  const FileDescriptor unkind = take_share_name(share, BoardRole::watch);
  const auto watcher = opened_in(io, BoardRole::watch);
  int came = 0;
  const auto until = Clock::now() + 800ms;
  while (Clock::now() < until) {
    while (accept_sharer(unkind.get())) ++came;
    run_for(io, 1ms);
  }
  EXPECT_GE(came, 3);
  EXPECT_LE(came, 40);
}

// --- other users

TEST_F(SharedCarrier, IsNotForOtherUsers) {
  const auto holder = opened(BoardRole::control);
  EXPECT_EQ(run_unprivileged([&] { return connect_to_holder(share, BoardRole::control) ? 1 : 0; }),
            0);
}

TEST_F(SharedCarrier, IsSharedWithTheGroupThatTheHolderNames) {
  // A user whose only group is that of user nobody (65534).
  const auto stop_it = [&](const ShareGroup& of) {
    return run_unprivileged([&] {
      const ShareName shared{share.text, of};
      const FileDescriptor connection = connect_to_holder(shared, BoardRole::control);
      if (!connection || !is_one_of_us(connection.get(), shared)) return 1;
      return send_message(connection.get(), ShareMessage::Kind::stop, stop);
    });
  };
  share.group = {"members", 65534};
  const auto holder = opened(BoardRole::control);
  EXPECT_NE(stop_it({"others", 65534}), 0) << "another group name";
  EXPECT_EQ(stop_it(share.group), 0);
  EXPECT_TRUE(run_until(io, [&] { return !device.sent.empty(); }));
  EXPECT_EQ(device.sent, std::vector<std::string>{stop});
  holder->carrier->close();
  share.group.id = 0;
  const auto strict = opened(BoardRole::control);
  stop_it(share.group);
  run_for(io, 20ms);
  EXPECT_EQ(device.sent.size(), 1U);
}

// Any user may bind the name of a holder.
TEST_F(SharedCarrier, OpensEvenIfAnotherUserHasTakenItsNames) {
  if (::geteuid() != 0) GTEST_SKIP() << "needs root, to act as another user";
  device.exclusive = false;
  const FileDescriptor squatters[] = {foreign_socket(BoardRole::control, true),
                                      foreign_socket(BoardRole::watch, true)};
  const auto driver = opened(BoardRole::control);
  const auto watcher = opened(BoardRole::watch);
  EXPECT_EQ(device.opened, 2);
  EXPECT_FALSE(watcher->carrier->is_shared());
  driver->carrier->close();
  watcher->carrier->change_role(BoardRole::control);
  EXPECT_TRUE(run_until(io, [&] { return device.opened == 3; }))
      << "a stranger must not prevent the change of control";
}

}  // namespace
}  // namespace r4::test
