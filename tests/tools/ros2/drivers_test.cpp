// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/r4/ros2/drivers.hpp"

#include <gtest/gtest.h>

#include "r4link/commands/command_text.hpp"
#include "r4link/tables/state_fields.hpp"
namespace r4::tool::ros2 {
namespace {

using namespace std::chrono_literals;

struct Driven {
  explicit Driven(Drivers::Duration deadline = 1000ms) : drivers(deadline) {}

  Drivers drivers;
  Drivers::Time now{1h};
  int topic = 0;
  int other_topic = 0;
  std::uint32_t executed = 0;  // CMD of the board's states

  void sent(const Command& command, std::uint64_t publisher = 7) {
    drivers.on_sent(command, &topic, publisher, now);
  }
  void told(int stepper, std::int32_t steps) {
    State state;
    state.present.add(state_field(FieldKind::stepper, stepper));
    state.raw.stepper_steps[stepper - 1] = steps;
    state.last_command = executed;
    drivers.on_state(state, now);
  }
  std::vector<std::string> to_stop() {
    std::vector<std::string> texts;
    for (const Command& each : drivers.to_stop(now).commands) texts.push_back(to_text(each));
    return texts;
  }
};
using Texts = std::vector<std::string>;

TEST(Ros2Drivers, StopTheOutputsOfASilentPublisher) {
  Driven driven;
  driven.sent(Command::osmc(2, Pwm(358), Direction::forward));
  driven.now += 999ms;
  EXPECT_EQ(driven.to_stop(), Texts{});
  driven.now += 1ms;
  EXPECT_EQ(driven.to_stop(), Texts{"O:0,1,2"});
  EXPECT_EQ(driven.to_stop(), Texts{"O:0,1,2"}) << "repeated until the board has confirmed it";
  driven.drivers.stopped(driven.drivers.to_stop(driven.now));
  EXPECT_EQ(driven.to_stop(), Texts{});
  EXPECT_FALSE(driven.drivers.any());
}

TEST(Ros2Drivers, StopTheOutputsOfADisconnectedPublisherAtOnce) {
  Driven driven;
  driven.sent(Command::osmc(1, Pwm(1), Direction::forward), 7);
  driven.sent(Command::dhb12(3, Pwm(1), Direction::reverse), 8);
  driven.drivers.on_publishers(&driven.other_topic, {});
  EXPECT_EQ(driven.to_stop(), Texts{}) << "the publisher belongs to another topic";
  driven.drivers.on_publishers(&driven.topic, {8});
  EXPECT_EQ(driven.to_stop(), Texts{"O:0,1,1"});
}

TEST(Ros2Drivers, SetEachOutputAsInTheSafeState) {
  Driven driven;
  driven.sent(Command::dhb12(4, Pwm(9), Direction::reverse));
  driven.sent(Command::servo(16, Microseconds(1500)));
  driven.sent(Command::relay(8, true));
  driven.sent(Command::bldc(1, Pwm(10), Direction::forward, false));
  driven.now += 2s;
  EXPECT_EQ(driven.to_stop(), (Texts{"D:0,1,4", "S:0,16", "R:8,Off", "B:0,1,1,1"}));
}

TEST(Ros2Drivers, AStepperStopsAtItsReportedPosition) {
  Driven driven;
  driven.sent(Command::stepper(2, Steps(100000), StepsPerSecond(1000)));
  driven.now += 2s;
  EXPECT_EQ(driven.to_stop(), Texts{});
  driven.told(2, 1234);
  EXPECT_EQ(driven.to_stop(), Texts{"P:1234,1000,2"});
}

TEST(Ros2Drivers, AStepperStopsWhenAnotherPartOfTheStateIsNewest) {
  Driven driven;
  driven.sent(Command::stepper(2, Steps(100000), StepsPerSecond(1000)));
  driven.told(2, 1234);
  State rest;
  rest.present.add(StateField::relays);
  driven.drivers.on_state(rest, driven.now);
  driven.drivers.on_publishers(&driven.topic, {});
  EXPECT_EQ(driven.to_stop(), Texts{"P:1234,1000,2"});
}

TEST(Ros2Drivers, AStepperDoesNotReturnToAnOldPosition) {
  Driven driven;
  driven.sent(Command::stepper(2, Steps(100000), StepsPerSecond(1000)));
  driven.told(2, 1234);
  driven.drivers.on_publishers(&driven.topic, {});
  driven.now += 251ms;
  EXPECT_EQ(driven.to_stop(), Texts{});
  driven.told(3, 5);
  EXPECT_EQ(driven.to_stop(), Texts{}) << "the position belongs to another stepper";
  driven.told(2, 1500);
  EXPECT_EQ(driven.to_stop(), Texts{"P:1500,1000,2"});
}

TEST(Ros2Drivers, IgnoreAStepperPositionFromBeforeItWasZeroed) {
  Driven driven;
  driven.sent(Command::stepper(2, Steps(100000), StepsPerSecond(1000)));
  driven.told(2, 50000);
  driven.sent(Command::zero(2));
  driven.drivers.on_publishers(&driven.topic, {});
  EXPECT_EQ(driven.to_stop(), Texts{});
  driven.now += 980ms;
  driven.told(2, 50020);  // this state is older than the zero command
  EXPECT_EQ(driven.to_stop(), Texts{});
  driven.now += 20ms;
  driven.told(2, 3);
  EXPECT_EQ(driven.to_stop(), Texts{"P:3,1000,2"}) << "the zero command may have been lost";
}

TEST(Ros2Drivers, UseAStepperPositionAsSoonAsTheBoardHasZeroedIt) {
  constexpr std::uint32_t zero = 0xFFFFFFFF;
  for (const std::uint32_t executed : {zero, 0U, 7U}) {
    Driven driven;
    driven.executed = zero - 1;
    driven.sent(Command::stepper(2, Steps(100000), StepsPerSecond(1000)));
    driven.sent(Command::zero(2));
    driven.drivers.on_number(Command::zero(2), zero);
    driven.drivers.on_publishers(&driven.topic, {});
    driven.now += 500ms;
    driven.told(2, 50020);
    EXPECT_EQ(driven.to_stop(), Texts{});
    driven.now += 20ms;
    driven.executed = executed;
    driven.told(2, 3);
    EXPECT_EQ(driven.to_stop(), Texts{"P:3,1000,2"}) << executed;
  }
}

TEST(Ros2Drivers, DoNotWaitForANumberOfAnEarlierSession) {
  Driven driven;
  driven.sent(Command::zero(2));
  driven.drivers.on_number(Command::zero(2), 500);
  driven.drivers.forget();
  driven.executed = 501;
  driven.told(2, 50020);
  driven.sent(Command::stepper(2, Steps(100000), StepsPerSecond(1000)));
  driven.drivers.on_publishers(&driven.topic, {});
  EXPECT_EQ(driven.to_stop(), Texts{}) << "the zero command may be under way";
}

TEST(Ros2Drivers, DoNotStopIdleOutputsOrRelay1) {
  Driven driven;
  driven.sent(Command::osmc(1, Pwm(0), Direction::forward));
  driven.sent(Command::servo(1, Microseconds(0)));
  driven.sent(Command::relay(2, false));
  driven.sent(Command::relay(1, true));
  driven.sent(Command::bldc(1, Pwm(0), Direction::forward, true));
  driven.now += 1h;
  EXPECT_FALSE(driven.drivers.any());
  EXPECT_EQ(driven.to_stop(), Texts{});
}

TEST(Ros2Drivers, AStopOfAPublisherIsRepeatedUntilConfirmed) {
  Driven driven;
  driven.sent(Command::osmc(1, Pwm(358), Direction::forward));
  driven.sent(Command::osmc(1, Pwm(0), Direction::forward));
  const Drivers::Stop stop = driven.drivers.to_stop(driven.now);
  ASSERT_EQ(stop.commands.size(), 1U) << "the first stop may have been lost";
  EXPECT_EQ(to_text(stop.commands[0]), "O:0,1,1");
  EXPECT_FALSE(stop.missed) << "no publisher has disappeared";
  // A publisher that drives with 0 repeats its command.
  driven.sent(Command::osmc(1, Pwm(0), Direction::forward));
  driven.drivers.stopped(stop);
  EXPECT_EQ(driven.to_stop(), Texts{});
  EXPECT_FALSE(driven.drivers.any());
}

TEST(Ros2Drivers, ReportThatAPublisherIsMissing) {
  Driven driven;
  driven.sent(Command::osmc(1, Pwm(358), Direction::forward));
  driven.now += 2s;
  EXPECT_TRUE(driven.drivers.to_stop(driven.now).missed);
}

TEST(Ros2Drivers, AVoltageIsSetToZeroAfterTheOtherOutputs) {
  Driven driven;
  driven.sent(Command::dac(2, Millivolts(3300)));
  driven.sent(Command::osmc(1, Pwm(358), Direction::forward));
  driven.now += 2s;
  const Drivers::Stop others = driven.drivers.to_stop(driven.now);
  ASSERT_EQ(others.commands.size(), 1U);
  EXPECT_EQ(to_text(others.commands[0]), "O:0,1,1");
  driven.drivers.stopped(others);
  EXPECT_EQ(driven.to_stop(), Texts{"X:DAC,2,0"});
  driven.drivers.forget(Command::dac(2, Millivolts(3300)));
  EXPECT_FALSE(driven.drivers.any()) << "an output that the board does not have must be forgotten";
}

TEST(Ros2Drivers, ANewCommandEndsTheStop) {
  Driven driven;
  driven.sent(Command::osmc(1, Pwm(358), Direction::forward), 7);
  driven.now += 2s;
  const Drivers::Stop stop = driven.drivers.to_stop(driven.now);
  driven.sent(Command::osmc(1, Pwm(100), Direction::forward), 8);
  EXPECT_EQ(driven.to_stop(), Texts{});
  driven.drivers.on_publishers(&driven.topic, {});
  driven.drivers.stopped(stop);
  EXPECT_EQ(driven.to_stop(), Texts{"O:0,1,1"}) << "the confirmation belongs to an earlier stop";
  driven.drivers.forget();
  EXPECT_FALSE(driven.drivers.any());
}

TEST(Ros2Drivers, WithoutADeadlineStopOnlyForADisconnectedPublisher) {
  Driven driven(0ms);
  driven.sent(Command::osmc(1, Pwm(358), Direction::forward), 7);
  driven.now += 24h;
  EXPECT_EQ(driven.to_stop(), Texts{});
  driven.drivers.on_publishers(&driven.topic, {});
  EXPECT_EQ(driven.to_stop(), Texts{"O:0,1,1"});
}

TEST(Ros2Drivers, StopOneGroupAtATime) {
  Driven driven;
  for (int n = 1; n <= servo_channels; ++n) driven.sent(Command::servo(n, Microseconds(1500)));
  for (int n = 1; n <= osmc_channels; ++n)
    driven.sent(Command::osmc(n, Pwm(1), Direction::forward));
  driven.now += 2s;
  const auto first = driven.drivers.to_stop(driven.now);
  EXPECT_EQ(first.commands.size(), static_cast<std::size_t>(max_group));
  driven.drivers.stopped(first);
  EXPECT_EQ(driven.to_stop().size(), 4U);
}

TEST(Ros2Drivers, ZeroingAStepperIsNotAStop) {
  EXPECT_TRUE(Drivers::rests(Command::osmc(1, Pwm(0), Direction::forward)));
  EXPECT_FALSE(Drivers::rests(Command::zero(1)));
}

}  // namespace
}  // namespace r4::tool::ros2
