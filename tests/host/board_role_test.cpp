// SPDX-License-Identifier: GPL-3.0-or-later
// An open board changes between watching and control: AsyncBoard and Board.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <asio/io_context.hpp>
#include <atomic>
#include <filesystem>
#include <future>
#include <memory>
#include <optional>
#include <string>

#include "r4link/async_board.hpp"
#include "r4link/board.hpp"
#include "r4link/recording.hpp"
#include "tests/support/board_in_a_thread.hpp"
#include "tests/support/carriers.hpp"
#include "tests/support/on_a_loop.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;

const Command turn_slowly = Command::osmc(1, Pwm(358), Direction::forward);

BoardOptions watching() {
  BoardOptions options;
  options.role = BoardRole::watch;
  return options;
}

struct BoardRoles : testing::TestWithParam<std::vector<std::string>>, OnALoop {
  // Waits for the outcome of the call that `start(handler)` begins.
  template <class Start>
  Outcome end_of(Start start) {
    return result_of(start).outcome;
  }
  bool hears_more_states() {
    const int before = states;
    return run_until([&] { return states > before + 2; });
  }
  void drive() {
    board.take_control();
    EXPECT_EQ(end_of([&](auto end) { board.async_wait_active(5s, end); }), Outcome::confirmed);
    EXPECT_EQ(end_of([&](auto end) { board.async_arm(3s, end); }), Outcome::confirmed);
    EXPECT_EQ(end_of([&](auto end) { board.async_send(turn_slowly, 3s, end); }),
              Outcome::confirmed);
  }
  Outcome release() {
    return end_of([&](auto end) { board.async_release_control(2s, end); });
  }

  BoardInAThread simulated{GetParam()};
  AsyncBoard board{io, simulated.urls(), watching()};
  int states = 0;
  Subscription counting = board.on_state([this](const auto&, const auto&) { ++states; });
};
// A path that is reopened for another role, a path that serves both roles, and both paths together.
const std::vector<std::string> kinds_of_paths[] = {{"pty"}, {"udp"}, {"pty", "udp"}};
INSTANTIATE_TEST_SUITE_P(Transports, BoardRoles, testing::ValuesIn(kinds_of_paths),
                         [](const auto& paths) {
                           return paths.param.size() > 1 ? "both" : paths.param[0];
                         });

TEST_P(BoardRoles, ChangeRepeatedlyAndKeepRecordingsAndStatistics) {
  const std::string path = testing::TempDir() + "board_roles-" + std::to_string(::getpid());
  Recording recording(path);
  board.record(recording);
  const ScopedSubscription linked = board.on_link([](const LinkStatus& link) {
    EXPECT_NE(link.state, HostLinkState::lost);
    EXPECT_FALSE(link.causes.has(LinkCause::transport_down));
  });
  const ScopedSubscription up_only = board.on_event([](const CarrierEvent& event) {
    EXPECT_EQ(event.kind, CarrierEvent::Kind::up) << event.problem.text();
  });
  board.open();
  ASSERT_TRUE(hears_more_states());
  for (int i = 0; i < 3; ++i) {
    drive();
    EXPECT_EQ(board.role(), BoardRole::control);
    EXPECT_EQ(board.state().osmc(1).pwm, 358);
    ASSERT_TRUE(hears_more_states());
    ASSERT_TRUE(run_until([&] { return !board.identity().board_id.empty(); }));
    const std::uint64_t heard = board.statistics().states;
    const std::uint64_t carried = board.carrier_counters().rx_datagrams;
    const std::uint64_t recorded = recording.records();
    EXPECT_EQ(release(), Outcome::confirmed);
    EXPECT_TRUE(simulated.is_without_host());
    EXPECT_EQ(board.role(), BoardRole::watch);
    EXPECT_EQ(board.disarmed_by(), DisarmCause::not_yet);
    ASSERT_TRUE(hears_more_states());
    EXPECT_EQ(board.link().reason, SafeReason::link);
    EXPECT_EQ(problem_of([&] { board.post(turn_slowly); }).kind, ErrorKind::usage);
    EXPECT_GT(board.statistics().states, heard);
    EXPECT_GT(board.carrier_counters().rx_datagrams, carried);
    EXPECT_GT(recording.records(), recorded);
    EXPECT_EQ(board.identity().board_id, "test-board");
  }
  EXPECT_EQ(board.statistics().packets.restarts, 0U);
  EXPECT_EQ(release(), Outcome::confirmed) << "the board is only watched already";
  recording.close();
  std::filesystem::remove(path);
}

TEST_P(BoardRoles, RefuseCommandsWhileControlIsBeingReleased) {
  board.open();
  drive();
  std::optional<CommandResult> released;
  board.async_release_control(2s, [&](const CommandResult& result) { released = result; });
  EXPECT_EQ(board.post(Command::relay(2, true)), PostResult::no_link);
  EXPECT_EQ(problem_of([&] { board.take_control(); }).kind, ErrorKind::usage);
  EXPECT_EQ(problem_of([&] { board.async_release_control(1s, [](const auto&) {}); }).kind,
            ErrorKind::usage);
  EXPECT_EQ(end_of([&](auto end) { board.async_send(Command::fields("ENC1"), 3s, end); }),
            Outcome::cancelled);
  ASSERT_TRUE(run_until([&] { return released.has_value(); }));
  EXPECT_EQ(released->outcome, Outcome::confirmed);
  const std::vector<std::string> executed = simulated.executed();
  EXPECT_EQ(std::count(executed.begin(), executed.end(), "R:2,On"), 0);
}

TEST_P(BoardRoles, MayChangeInACallback) {
  board.open();
  ASSERT_TRUE(hears_more_states());
  std::optional<CommandResult> released;
  const ScopedSubscription takes = board.on_state([&](const auto&, const auto&) {
    if (board.role() == BoardRole::watch) board.take_control();
  });
  ASSERT_TRUE(run_until([&] { return board.in_control(); }));
  const ScopedSubscription releases = board.on_board_heartbeat([&](const Datagram&) {
    if (released || board.role() == BoardRole::watch) return;
    released.emplace();
    board.async_release_control(2s, [&](const CommandResult& result) { released = result; });
  });
  ASSERT_TRUE(run_until([&] { return released && released->outcome == Outcome::confirmed; }));
  ASSERT_TRUE(run_until([&] { return board.in_control(); }))
      << "the callback takes control at each state";
}

TEST_P(BoardRoles, ReleaseTimesOutOnASilentBoard) {
  board.open();
  drive();
  simulated.switch_off();
  EXPECT_NE(end_of([&](auto end) { board.async_release_control(60ms, end); }), Outcome::confirmed);
  EXPECT_EQ(board.role(), BoardRole::watch);
}

TEST_P(BoardRoles, EndWithTheBoard) {
  board.open();
  drive();
  std::optional<CommandResult> released, closed;
  board.async_release_control(2s, [&](const CommandResult& result) { released = result; });
  board.async_close(2s, [&](const CommandResult& result) { closed = result; });
  ASSERT_TRUE(run_until([&] { return released && closed; }));
  EXPECT_EQ(released->outcome, Outcome::closed);
  EXPECT_TRUE(closed->outcome == Outcome::confirmed || closed->outcome == Outcome::refused)
      << "the board may have obeyed the first farewell already";
  EXPECT_TRUE(simulated.is_without_host());
  EXPECT_EQ(problem_of([&] { board.take_control(); }).kind, ErrorKind::usage);
}

// A path on which another program may control the board.
struct Contested final : IdleCarrier {
  explicit Contested(bool taken) : is_taken(taken) {}
  void change_role(BoardRole role) override {
    if (is_taken) throw Error(ErrorKind::refused, name(), "taken");
    roles.push_back(role);
  }
  const bool is_taken;
  std::vector<BoardRole> roles;
};

TEST(BoardRole, TakeControlFailsOnAllPathsIfOnePathIsTaken) {
  asio::io_context io;
  std::vector<std::unique_ptr<Carrier>> paths;
  auto free = std::make_unique<Contested>(false);
  const Contested& first = *free;
  paths.push_back(std::move(free));
  paths.push_back(std::make_unique<Contested>(true));
  AsyncBoard board(io, std::move(paths), watching());
  EXPECT_EQ(problem_of([&] { board.take_control(); }).kind, ErrorKind::usage)
      << "the board is not open yet";
  board.open();
  EXPECT_EQ(problem_of([&] { board.take_control(); }).reason, "taken");
  EXPECT_EQ(first.roles, (std::vector<BoardRole>{BoardRole::control, BoardRole::watch}));
  EXPECT_EQ(board.role(), BoardRole::watch);
}

TEST(BoardRole, TakeControlNamesTheControllingProgramAndKeepsWatching) {
  BoardInAThread simulated("pty");
  Board watcher(simulated.url(), watching());
  watcher.wait_active();
  EXPECT_EQ(watcher.role(), BoardRole::watch);
  {
    Board driver(simulated.url());
    driver.wait_active();
    const Problem held = problem_of([&] { watcher.take_control(); });
    EXPECT_EQ(held.kind, ErrorKind::refused);
    ASSERT_TRUE(held.holder);
    EXPECT_EQ(held.holder->pid, ::getpid());
    EXPECT_EQ(watcher.role(), BoardRole::watch);
    EXPECT_GT(watcher.next_state().t_ms, 0U);
    driver.release_control();
    EXPECT_EQ(driver.role(), BoardRole::watch);
    EXPECT_EQ(problem_of([&] { driver.arm(); }).kind, ErrorKind::usage);
    EXPECT_EQ(problem_of([&] { driver.post(turn_slowly); }).kind, ErrorKind::usage);
    watcher.take_control();
    watcher.wait_active();
    EXPECT_GT(driver.next_state().t_ms, 0U)
        << "a watcher hears states while another program controls";
  }
  watcher.close();
  EXPECT_EQ(problem_of([&] { watcher.take_control(); }).outcome, Outcome::closed);
  EXPECT_EQ(problem_of([&] { watcher.release_control(); }).outcome, Outcome::closed);
}

// Commands of other threads may reach the loop during the change. Then no motor turns, and the
// program continues.
TEST(BoardRole, MayBeChangedWhileOtherThreadsCommand) {
  BoardInAThread simulated("udp");
  BoardOptions options = watching();
  options.session.arming = Arming::off;
  Board board(simulated.url(), options);
  board.wait_active();
  std::atomic<bool> done = false;
  const auto again_and_again = [&](auto command) {
    return std::async(std::launch::async, [&done, command] {
      while (!done) {
        try {
          command();
        } catch (const Error&) {
        }
      }
    });
  };
  const auto posting = again_and_again([&] { board.post(turn_slowly); });
  const auto sending = again_and_again([&] { board.send(turn_slowly, 100ms); });
  EXPECT_NO_THROW({
    for (int i = 0; i < 10; ++i) {
      board.take_control();
      board.wait_active();
      board.release_control();
      EXPECT_EQ(board.role(), BoardRole::watch);
    }
  });
  done = true;
  posting.wait();
  sending.wait();
  EXPECT_TRUE(simulated.is_without_host());
}

}  // namespace
}  // namespace r4::test
