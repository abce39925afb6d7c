// SPDX-License-Identifier: GPL-3.0-or-later
// The guard in the timer interrupt: the faults that it notices, when it notices them, and the
// effect on the application.
#include "firmware/guard.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <initializer_list>

#include "tests/firmware/board_fixture.hpp"

namespace r4 {
namespace {

using firmware::Guard;
using test::another_session;
using test::MemoryHal;
using test::our_session;
using test::TestBoard;
using test::TestHost;

struct GuardTest : testing::Test {
  // Ticks for `ms` milliseconds. In each millisecond the duties of `alive` check in. Returns the
  // number of ticks that returned true.
  int run(std::uint32_t ms, std::initializer_list<Guard::Duty> alive = {}) {
    int fed = 0;
    for (std::uint32_t i = 0; i < ms; ++i) {
      for (const Guard::Duty duty : alive) guard.check_in(duty);
      if (guard.tick(++now_ms)) ++fed;
    }
    return fed;
  }

  MemoryHal hal;
  Guard guard{hal};
  std::uint32_t now_ms = 0xfffffff0U;  // wraps during the test
};

TEST_F(GuardTest, FeedsTheWatchdogOnlyWhenEveryDutyHasCheckedIn) {
  const Guard::Duty loop = guard.add_duty(20);
  const Guard::Duty wifi = guard.add_duty(1000);
  EXPECT_EQ(run(10, {loop, wifi}), 10);
  EXPECT_EQ(run(10, {loop}), 0);
  EXPECT_EQ(run(10, {wifi}), 1);  // the loop has checked in before
  EXPECT_EQ(run(10), 0);
}

TEST_F(GuardTest, FeedsTheWatchdogIfThereAreNoDuties) { EXPECT_EQ(run(3), 3); }

// Outputs must not be live without a guard. A developer who adds too many duties notices the fault
// at once.
TEST_F(GuardTest, TooManyDutiesKeepOutputsSafeAndTheWatchdogUnfed) {
  for (int i = 0; i < Guard::max_duties; ++i) EXPECT_EQ(guard.add_duty(20), i);
  EXPECT_EQ(run(1, {0, 1, 2, 3, 4, 5, 6, 7}), 1);
  EXPECT_FALSE(guard.tripped());
  EXPECT_EQ(guard.add_duty(20), Guard::no_duty);
  EXPECT_EQ(run(10, {0, 1, 2, 3, 4, 5, 6, 7, Guard::no_duty}), 0);
  EXPECT_EQ(guard.take(), SafeReason::watchdog);
  run(1, {0, 1, 2, 3, 4, 5, 6, 7});
  EXPECT_EQ(guard.take(), SafeReason::watchdog) << "also after it was cleared";
}

TEST_F(GuardTest, AHangingDutyTripsAfterFiveDeadlines) {
  const Guard::Duty loop = guard.add_duty(20);
  run(50, {loop});
  run(99);
  EXPECT_FALSE(guard.tripped());
  EXPECT_EQ(guard.missed(), 4U);
  EXPECT_EQ(hal.made_safe, 0);
  run(1);
  EXPECT_TRUE(guard.tripped());
  EXPECT_EQ(hal.made_safe, 1);
  EXPECT_EQ(guard.take(), SafeReason::watchdog);
  EXPECT_FALSE(guard.tripped());
}

TEST_F(GuardTest, OccasionalMissesAreCountedButDoNotTrip) {
  const Guard::Duty loop = guard.add_duty(20);
  for (int i = 0; i < 100; ++i) {
    run(480, {loop});
    run(20);
  }
  EXPECT_EQ(guard.missed(), 100U);
  EXPECT_FALSE(guard.tripped());
}

TEST_F(GuardTest, FrequentMissesTripTheGuard) {
  const Guard::Duty loop = guard.add_duty(20);
  int periods = 0;
  for (; !guard.tripped() && periods < 100; ++periods) {
    run(230, {loop});
    run(20);
  }
  EXPECT_GT(periods, 5);
  EXPECT_LT(periods, 20);
}

TEST_F(GuardTest, MakesTheOutputsSafeAtTheDeadlineAndNotBefore) {
  guard.arm(now_ms + 100);
  run(99);
  EXPECT_EQ(hal.made_safe, 0);
  run(1);
  EXPECT_EQ(hal.made_safe, 1);
  EXPECT_EQ(guard.take(), SafeReason::link);
  run(1000);
  EXPECT_EQ(hal.made_safe, 1);
}

TEST_F(GuardTest, ADeadlineCanBePostponedOrCancelled) {
  guard.arm(now_ms + 100);
  run(99);
  guard.arm(now_ms + 100);
  run(99);
  guard.disarm();
  run(1000);
  EXPECT_FALSE(guard.tripped());
}

TEST_F(GuardTest, RemembersTheGraverOfTwoCauses) {
  guard.add_duty(20);
  guard.arm(now_ms + 10);
  run(200);
  EXPECT_EQ(guard.take(), SafeReason::watchdog);
  EXPECT_EQ(hal.made_safe, 2);
}

TEST_F(GuardTest, ExecutesAStopAtTheNextTickAsTheGravestCause) {
  guard.add_duty(20);
  guard.stop();
  EXPECT_EQ(hal.made_safe, 0);
  run(1);
  EXPECT_EQ(hal.made_safe, 1);
  guard.arm(now_ms + 10);
  run(200);
  guard.stop();
  run(1);
  EXPECT_EQ(hal.made_safe, 1);
  EXPECT_EQ(guard.take(), SafeReason::stop);
  EXPECT_FALSE(guard.tripped());
}

// --- with the application

struct GuardedBoard : testing::Test {
  GuardedBoard() {
    host.connect();
    host.stay(300);
    host.command("O:358,1,1");
    EXPECT_EQ(board.outputs().osmc[0].pwm, 358);
    board.log.states.clear();
  }
  // The timer runs, but the loop hangs.
  void hang(std::uint32_t ms) {
    for (std::uint32_t i = 0; i < ms; ++i) guard().tick(++board.now_ms);
  }
  Guard& guard() { return board.application->guard(); }

  TestBoard board;
  TestHost host{board, our_session, Source{0, 4}};
};

TEST_F(GuardedBoard, SilenceMakesAHungLoopSafeDespiteAWaitingHeartbeat) {
  const std::uint32_t fed_ms = board.application->link().fed_ms();
  board.now_ms = fed_ms + 990;  // 10 ms are left, and the loop hangs for 11 ms
  guard().tick(board.now_ms);
  hang(9);
  EXPECT_FALSE(board.safe());
  hang(1);
  EXPECT_TRUE(board.safe());
  host.echo();
  EXPECT_EQ(board.log.states.front(), "SAFE link");
}

TEST_F(GuardedBoard, AStopHeardByAnInterruptActsBeforeTheLoopReadsIt) {
  guard().stop();
  guard().tick(board.now_ms);
  EXPECT_TRUE(board.safe());
  EXPECT_TRUE(board.log.states.empty());
  host.command("E:STOP");
  EXPECT_EQ(board.log.states, std::vector<std::string>{"SAFE stop"});
  host.command("O:400,1,1");
  EXPECT_TRUE(board.safe());
  board.run(10);
  host.echo();
  host.clear();
  host.command("O:400,1,1");
  EXPECT_EQ(board.outputs().osmc[0].pwm, 400);
}

TEST_F(GuardedBoard, ARepeatedStopHeardByAnInterruptIsNotANewCause) {
  const auto heard = [&](std::uint32_t number) {
    guard().stop();
    guard().tick(board.now_ms);
    board.run(1);
    host.resend("E:STOP", number);
    board.run(1);
  };
  const std::uint32_t number = host.pnum++;
  heard(number);
  const firmware::Application& application = *board.application;
  const std::int32_t cause = application.safe_report().cause;
  EXPECT_EQ(application.safe_report().stop, number);
  for (int i = 0; i < 5; ++i) heard(number);
  EXPECT_EQ(application.safe_report().cause, cause);
  heard(host.pnum++);
  EXPECT_EQ(application.safe_report().cause, cause + 1);
  host.echo();
  host.clear();
  EXPECT_EQ(board.reason(), SafeReason::none);
  guard().stop();  // the number of this stop is unknown until the loop reads it
  guard().tick(board.now_ms);
  board.run(1);
  EXPECT_EQ(board.reason(), SafeReason::stop);
  EXPECT_FALSE(application.safe_report().has_stop);
}

// An interrupt detects stops. The stop datagrams are then lost, because a port has no room.
class StopWithoutDatagram : public GuardedBoard {
 protected:
  void hear() {
    guard().stop();
    guard().tick(board.now_ms);
    board.run(1);
  }
  std::int32_t cause() const { return board.application->safe_report().cause; }
  // True if an E:CLEAR that names that cause makes the board leave the safe state.
  bool clears(std::int32_t named) {
    host.echo();
    host.command("E:CLEAR," + std::to_string(named));
    return board.reason() != SafeReason::stop;
  }
  static constexpr std::uint32_t lost_ms = firmware::Application::catch_up_ms;
};

TEST_F(StopWithoutDatagram, DiffersFromALaterStopOfAnotherHost) {
  hear();
  const std::int32_t heard = cause();
  host.resend("E:STOP", host.pnum++);
  EXPECT_NE(cause(), heard);
  EXPECT_FALSE(clears(heard)) << "the clear was asked for before the second stop";
  EXPECT_TRUE(clears(cause()));
}

TEST_F(StopWithoutDatagram, IsANewCauseOnAStoppedBoard) {
  host.resend("E:STOP", host.pnum++);
  const std::int32_t first = cause();
  hear();
  EXPECT_FALSE(clears(first)) << "the stop may still be a repetition";
  board.run(lost_ms);
  EXPECT_NE(cause(), first);
  EXPECT_FALSE(clears(first));
  EXPECT_TRUE(clears(cause()));
}

TEST_F(StopWithoutDatagram, IsANewCauseEvenIfTheFirstStopIsRepeated) {
  const std::uint32_t number = host.pnum++;
  host.resend("E:STOP", number);
  const std::int32_t first = cause();
  hear();
  hear();
  host.resend("E:STOP", number);
  EXPECT_EQ(cause(), first);
  board.run(lost_ms);
  EXPECT_NE(cause(), first);
}

TEST_F(GuardedBoard, OutputsStayOffAfterTheGuardTripsDuringACommand) {
  // The guard trips after the loop has read the time and before the loop executes its command.
  class Trip final : public firmware::Observer {
   public:
    void on_state(std::uint32_t, firmware::BoardState, SafeReason) override {}
    void on_outputs(std::uint32_t, const firmware::Outputs&) override {}
    void on_executed(std::uint32_t, std::uint32_t, const Command&) override { trip(); }
    void on_refused(std::uint32_t, std::uint32_t, Refusal) override {}
    void on_rejected(std::uint32_t, Verdict) override {}
    std::function<void()> trip = [] {};
  } observer;
  MemoryHal hal;
  test::MemoryPort port;
  std::uint32_t now_ms = 1000;
  port.now_ms = &now_ms;
  firmware::Application application(hal, {}, &observer);
  application.add_port(port);
  application.start(now_ms);
  const auto say = [&](const std::string& fields) {
    const std::string bytes = test::with_crc(fields);
    application.receive(0, 1, bytes, now_ms);
  };
  say("H:ROS2-R4;PNum:1;T:5;");
  observer.trip = [&] {
    const std::uint32_t deadline_ms = application.link().deadline_ms();
    application.guard().tick(deadline_ms);
  };
  const int applied = hal.applied;
  say("O:100,1,1;PNum:2;T:5;");
  EXPECT_EQ(hal.outputs, firmware::Outputs());
  EXPECT_EQ(hal.applied, applied);  // the outputs do not change even briefly
  observer.trip = [] {};
  application.poll(++now_ms);
  EXPECT_EQ(application.reason(), SafeReason::link);
}

}  // namespace
}  // namespace r4
