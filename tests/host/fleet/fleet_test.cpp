// SPDX-License-Identifier: GPL-3.0-or-later
// r4::Fleet with simulated boards, in the process of the fleet and over UDP.
#include "r4link/fleet.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "r4link/error.hpp"
#include "tests/support/at_will.hpp"
#include "tests/support/board_in_a_thread.hpp"
#include "tests/support/problems.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using Boards = Fleet::Boards;

struct ActiveFleet : Fleet {
  explicit ActiveFleet(const std::vector<std::string>& urls, const BoardOptions& options = {})
      : Fleet(urls, options) {
    EXPECT_EQ(wait_active(), Boards{});
  }
};

// True if `done()` becomes true within 5 s.
template <class Done>
[[nodiscard]] bool comes(Done done) {
  const auto deadline = Clock::now() + 5s;
  while (!done()) {
    if (Clock::now() > deadline) return false;
    std::this_thread::yield();
  }
  return true;
}

Setpoints motor(int pwm) { return Setpoints{Command::osmc(1, Pwm(pwm), Direction::forward)}; }

TEST(Fleet, FindsTheBoardsOfAPatternByIndexUrlAndId) {
  ActiveFleet fleet({"sim:?node=0-7", "sim:?node=20"});
  ASSERT_EQ(fleet.size(), 9U);
  EXPECT_EQ(fleet.url(3), "sim:?node=3");
  EXPECT_EQ(fleet.url(8), "sim:?node=20");
  EXPECT_EQ(fleet.find("sim:?node=20"), 8U);
  ASSERT_TRUE(fleet.send(Command::identify()).all_confirmed());
  EXPECT_EQ(fleet["sim-5"].index(), 5U);
  for (const BoardHealth& each : fleet.health()) {
    EXPECT_TRUE(each.well()) << each.url;
    EXPECT_EQ(each.disarmed_by, DisarmCause::not_yet);
  }
}

TEST(Fleet, ReportsAResultOfEachBoardAndCountsFailures) {
  ActiveFleet fleet({"sim:?node=0-3"});
  fleet.arm().require();
  fleet[2].stop();
  const FleetResults results = fleet.send("O:358,1,1");
  ASSERT_EQ(results.size(), 4U);
  EXPECT_EQ(results.failed(), Boards{2});
  EXPECT_FALSE(results.all_confirmed());
  EXPECT_EQ(results[2].result.outcome, Outcome::not_armed);
  EXPECT_EQ(results[2].problem.thing, "sim:?node=2: O:358,1,1");
  const Problem problem = problem_of([&] { results.require(); });
  EXPECT_EQ(problem.kind, ErrorKind::refused);
  EXPECT_EQ(problem.outcome, Outcome::not_armed);
  const std::vector<ReceivedState> states = fleet.states();
  for (const std::size_t board : {0U, 1U, 3U}) {
    EXPECT_EQ(states[board].osmc(1), (Drive{358, Direction::forward})) << board;
  }
  EXPECT_EQ(states[2].osmc(1).pwm, 0);
  fleet[3].stop();
  const FleetResults two = fleet.send({3, 2, 0}, "O:1,1,1");
  EXPECT_EQ(two.failed(), (Boards{3, 2}));
  EXPECT_TRUE(contains(problem_of([&] { two.require(); }).reason, "(and 1 other boards)"));
}

TEST(Fleet, StopsAllBoardsUntilTheyAreCleared) {
  ActiveFleet fleet({"sim:?node=0-7"}, at_will());
  fleet.send(Command::osmc(1, Pwm(500), Direction::forward)).require();
  EXPECT_TRUE(fleet.stop().all_confirmed());
  EXPECT_EQ(fleet.send("O:1,1,1").failed().size(), 8U);
  fleet.send(Command::clear()).require();
  fleet.send("O:1,1,1").require();
}

TEST(Fleet, SendsSetpointsOfSeveralBoards) {
  ActiveFleet fleet({"sim:?node=0-7"}, at_will());
  std::vector<BoardSetpoints> setpoints;
  for (std::size_t i = 0; i < 8; ++i) setpoints.push_back({i, motor(100 + static_cast<int>(i))});
  // A group is sent only after the board has reported that it executes groups.
  ASSERT_TRUE(comes([&] {
    for (const PostResult each : fleet.post(setpoints)) {
      if (!each) return false;
    }
    return true;
  }));
  EXPECT_TRUE(comes([&] {
    const std::vector<ReceivedState> states = fleet.states();
    for (std::size_t i = 0; i < 8; ++i) {
      if (states[i].osmc(1).pwm != 100 + i) return false;
    }
    return true;
  }));
  setpoints.resize(2);
  setpoints[0].setpoints = motor(7);
  setpoints[1].setpoints = motor(8);
  fleet.send(setpoints).require();
  EXPECT_EQ(fleet[0].state().osmc(1).pwm, 7);
  EXPECT_EQ(fleet[1].state().osmc(1).pwm, 8);
  EXPECT_EQ(fleet[2].state().osmc(1).pwm, 102);
}

TEST(Fleet, ReportsASilentBoardAndDrivesTheOtherBoards) {
  BoardInAThread one("udp"), two("udp");
  ActiveFleet fleet({one.url(), two.url()}, at_will());
  while (fleet.next_event()) {
  }
  one.switch_off();
  std::optional<FleetEvent> event;
  do {
    event = fleet.next_event(5s);
    ASSERT_TRUE(event);
  } while (event->kind != FleetEvent::Kind::link || is_heard(event->link.state));
  EXPECT_EQ(event->board, 0U);
  EXPECT_EQ(fleet.wait_active(0ms), Boards{0});
  EXPECT_EQ(fleet.send("O:5,1,1", 200ms).failed(), Boards{0});
  EXPECT_EQ(fleet[1].state().osmc(1).pwm, 5);
}

TEST(Fleet, RepeatsAStopAfterItsCallHasReturned) {
  const std::string url = BoardInAThread("udp").url();  // the board has ended
  Fleet fleet({url}, at_will());
  EXPECT_EQ(fleet.stop(50ms).failed(), Boards{0});
  BoardInAThread late(url.substr(0, url.find('?')));
  EXPECT_TRUE(late.wait_for(firmware::BoardState::safe, SafeReason::stop));
}

TEST(Fleet, CountsEventsThatTheProgramDoesNotRead) {
  ActiveFleet fleet({"sim:?node=0-31"});
  // Each stop and its end are at least two events of a board.
  for (int i = 0; i < 70; ++i) {
    ASSERT_TRUE(fleet.stop().all_confirmed());
    fleet.send(Command::clear()).require();
  }
  const std::optional<FleetEvent> first = fleet.next_event();
  ASSERT_TRUE(first);
  EXPECT_EQ(first->kind, FleetEvent::Kind::missed);
  EXPECT_GT(first->count, 0U);
  EXPECT_NE(fleet.next_event()->kind, FleetEvent::Kind::missed);
}

TEST(Fleet, SendsOnlyStopsAsAWatcher) {
  BoardOptions options;
  options.role = BoardRole::watch;
  ActiveFleet fleet({"sim:?node=0-1"}, options);
  EXPECT_EQ(problem_of([&] { fleet.send("O:1,1,1"); }).kind, ErrorKind::usage);
  EXPECT_EQ(problem_of([&] { fleet.post({{0, motor(1)}}); }).kind, ErrorKind::usage);
  EXPECT_TRUE(fleet.stop().all_confirmed());
}

TEST(Fleet, StopsAllHeartbeatsByItsWatchdog) {
  ActiveFleet fleet({"sim:?node=0-1"}, at_will());
  fleet.watchdog(50ms);
  EXPECT_TRUE(comes([&] {
    const std::vector<BoardHealth> all = fleet.health();
    return all[0].link.cause() == LinkCause::watchdog && all[1].link.cause() == LinkCause::watchdog;
  }));
  fleet.watchdog(0ms);
  fleet.feed();
  EXPECT_EQ(fleet.wait_active(), Boards{});
}

TEST(Fleet, RefusesInvalidUrlsBoardsAndCommands) {
  const auto problem = [](const std::vector<std::string>& urls) {
    return problem_of([&] { Fleet fleet(urls); });
  };
  EXPECT_EQ(problem({}).kind, ErrorKind::usage);
  EXPECT_EQ(problem({"sim:?node=0-3", "sim:?node=2"}).text(),
            "sim:?node=2: the board is named twice; name each board once");
  EXPECT_EQ(problem({"sim:", "serial:///dev/no-such-port"}).kind, ErrorKind::open);
  Fleet fleet({"sim:?node=0-1"});
  EXPECT_EQ(problem_of([&] { fleet.send({2}, "O:1,1,1"); }).text(),
            "board 2: the fleet has no such board; give 0 to 1");
  EXPECT_EQ(problem_of([&] { fleet.find("nobody"); }).kind, ErrorKind::usage);
  EXPECT_EQ(problem_of([&] { fleet.send("O:1,1,9"); }).kind, ErrorKind::usage);
}

TEST(Fleet, EndsEveryCallAsClosedAfterClose) {
  ActiveFleet fleet({"sim:?node=0-7"});
  fleet.close();
  fleet.close();
  EXPECT_EQ(problem_of([&] { fleet.arm(); }).outcome, Outcome::closed);
  EXPECT_EQ(problem_of([&] { fleet.states(); }).outcome, Outcome::closed);
  EXPECT_EQ(problem_of([&] { fleet.wait_active(); }).outcome, Outcome::closed);
}

TEST(Fleet, EndsACallWithTheExceptionOfOnWait) {
  BoardInAThread simulated("udp");
  bool interrupts = false;
  BoardOptions options = at_will();
  options.on_wait = [&interrupts] {
    if (interrupts)
      throw Error(Problem{ErrorKind::refused, "the call", "", "", Outcome::cancelled});
  };
  ActiveFleet fleet({simulated.url()}, options);
  simulated.switch_off();
  interrupts = true;
  const auto begun = Clock::now();
  EXPECT_EQ(problem_of([&] { fleet.send("O:1,1,1", 10s); }).outcome, Outcome::cancelled);
  EXPECT_LT(Clock::now() - begun, 5s);
}

TEST(Fleet, RecordsAllBoardsInOneFile) {
  const std::string path = testing::TempDir() + "fleet_test.r4log";
  {
    Recording recording(path);
    Fleet fleet({"sim:?node=0-3"});
    fleet.record(recording);
    ASSERT_EQ(fleet.wait_active(), Boards{});
  }
  struct Paths final : RecordingVisitor {
    std::set<int> paths;
    RecordedStates states;
    void on_record(const Record& record) override {
      if (states.take(record) != nullptr) paths.insert(record.path);
    }
    void on_damage(const RecordingDamage& damage) override { ADD_FAILURE() << damage.reason; }
  } read;
  read_recording(path, read);
  EXPECT_EQ(read.paths.size(), 4U);
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace r4::test
