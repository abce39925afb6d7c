// SPDX-License-Identifier: GPL-3.0-or-later
// A group of commands in one datagram: the board executes all commands in one step, or no command.
#include <gtest/gtest.h>

#include "tests/firmware/board_fixture.hpp"

namespace r4 {
namespace {

using Lines = std::vector<std::string>;

struct ApplicationGroup : test::BoardInControl {
  // The answers, each with the command that it refuses: "FORMAT AT:2".
  Lines refusals() {
    Lines lines;
    for (const test::Heard& heard : board.take(MessageKind::nack)) {
      Datagram datagram;
      Nack nack;
      EXPECT_TRUE(read_datagram(heard.bytes, datagram) && read_nack(datagram, nack));
      const Field at = datagram.find("AT");
      lines.push_back(test::str(name_of(nack.code)) +
                      (at.name().empty() ? "" : " AT:" + test::str(at.values())));
    }
    return lines;
  }
};

TEST_F(ApplicationGroup, ReachesTheHardwareInOneCall) {
  const int applied = board.hal.applied;
  const std::uint32_t number = host.command(
      "O:358,1,1;O:358,1,2;O:358,0,3;D:7,1,4;S:1500,16;R:8,On;P:-100,2;B:9,1,0,3;Z:4;X:DAC,2,1650");
  EXPECT_EQ(board.hal.applied, applied + 1);
  EXPECT_EQ(refusals(), Lines());
  firmware::Outputs expected;
  expected.osmc[0] = expected.osmc[1] = {358, Direction::forward};
  expected.osmc[2] = {358, Direction::reverse};
  expected.dhb12[3] = {7, Direction::forward};
  expected.servo_us[15] = 1500;
  expected.relays = 0x80;
  expected.stepper[1].position = -100;
  expected.stepper[1].enabled = true;
  expected.bldc[2] = {9, Direction::forward, false};
  expected.dac_mv[1] = 1650;
  EXPECT_EQ(board.outputs(), expected);
  EXPECT_EQ(board.hal.zeroed, std::vector<int>{4});
  EXPECT_EQ(board.log.executed, std::vector<std::uint32_t>(10, number));
  EXPECT_EQ(board.application->link().last_executed(), number);
}

TEST_F(ApplicationGroup, ChangesNothingIfOneCommandIsWrong) {
  const int applied = board.hal.applied;
  const std::pair<const char*, const char*> cases[] = {
      {"O:1,1,1;O:4096,1,2", "RANGE AT:2"},
      {"O:1,1,1;S:1,17", "CHANNEL AT:2"},
      {"O:1,1;O:1,1,2", "FORMAT AT:1"},
      {"O:1,1,1;O:2,1,1", "FORMAT AT:2"},
      {"O:1,1,1;C:rate,50", "FORMAT AT:2"},
      {"O:1,1,1;U:10,1", "FORMAT AT:2"},
      {"O:1,1,1;F:ALL", "FORMAT AT:2"},
      {"Q:ID;O:1,1,1", "FORMAT AT:1"},
      {"H:ROS2-R4;O:1,1,1", "FORMAT AT:1"},
      {"O:1,1,1;E:CLEAR,0", "FORMAT AT:2"},
      {"O:1,1,1;X:1", "UNKNOWN AT:2"},
      {"N:1,SAFE;O:1,1,1", "UNKNOWN AT:1"},
      {"O:1,1,1;X:DAC,1,3301", "RANGE AT:2"},
      {"X:DAC,1,5;X:UART,1,x41", "FORMAT AT:2"},
      {"Z:1;Z:1", "FORMAT AT:2"},
      {"C:rate,50;C:rate,60", "FORMAT AT:1"},
  };
  for (const auto& [fields, answer] : cases) {
    host.command(fields);
    EXPECT_EQ(refusals(), Lines{answer}) << fields;
  }
  std::string many;
  for (int i = 1; i <= 16; ++i) many += "S:1500," + std::to_string(i) + ";";
  host.command(many + "O:1,1,1");
  EXPECT_EQ(refusals(), Lines{"FORMAT AT:17"});
  EXPECT_TRUE(board.safe());
  EXPECT_EQ(board.hal.applied, applied);
  EXPECT_EQ(board.hal.zeroed, std::vector<int>());
  EXPECT_EQ(board.log.executed.size(), 0U);
  EXPECT_EQ(board.application->settings().state_rate_hz, 100);
  host.command(many.substr(0, many.size() - 1));
  EXPECT_EQ(board.log.executed.size(), 16U) << "a group may have sixteen commands";
}

TEST_F(ApplicationGroup, IsExecutedOnceAndInOrder) {
  const std::uint32_t late = host.pnum++;
  const std::uint32_t number = host.command("P:1,1;P:1,2");
  host.resend("P:1,1;P:1,2", number);
  host.resend("P:2,1;P:2,2", late);
  EXPECT_EQ(refusals(), (Lines{"DUPLICATE", "STALE"}));
  EXPECT_EQ(board.log.executed, std::vector<std::uint32_t>(2, number));
  // Without a number, the board could not execute the group exactly once.
  board.receive("O:1,1,1;O:1,1,2;T:1;", host.at);
  board.receive("O:1,1,1;O:1,1,2;PNum:5;T:1;", Source{0, 9});
  EXPECT_EQ(refusals(), Lines{"BUSY"});
  EXPECT_EQ(board.outputs().osmc[0].pwm, 0);
}

TEST_F(ApplicationGroup, IsRefusedAsAWholeWhileTheOutputsAreSafe) {
  board.hal.inputs.handle = Handle::released;
  board.run(10);
  const std::uint32_t number = host.command("O:1,1,1;Z:1");
  EXPECT_EQ(refusals(), Lines{"SAFE"});
  EXPECT_EQ(board.hal.zeroed, std::vector<int>());
  board.hal.inputs.handle = Handle::held;
  board.run(10);
  host.resend("O:1,1,1;Z:1", number);
  EXPECT_EQ(refusals(), Lines{"SAFE"}) << "the number of the group is used up";
  EXPECT_TRUE(board.safe());
}

TEST_F(ApplicationGroup, StopsTheBoardIfItContainsAStop) {
  host.command("O:1,1,1;O:1,1,2");
  for (const char* fields : {"O:358,1,1;E:STOP;O:358,1,2", "E:STOP;C:rate,50", "X:1;E:STOP"}) {
    host.command(fields);
    EXPECT_EQ(board.reason(), SafeReason::stop) << fields;
    EXPECT_TRUE(board.safe()) << fields;
    host.clear();
    EXPECT_EQ(board.reason(), SafeReason::none) << fields;
    EXPECT_TRUE(board.safe()) << fields;
  }
}

// Closing the supply moves nothing (docs/reference/safety.md), but a later command of the group
// moves an output.
TEST_F(ApplicationGroup, AppliesItsCommandsInOrder) {
  host.command("O:358,1,1;R:1,On");
  EXPECT_EQ(board.outputs().relays, 1);
  EXPECT_EQ(board.outputs().osmc[0].pwm, 0);
  host.command("R:1,Off");
  host.command("R:1,On;O:358,1,1");
  EXPECT_EQ(board.outputs().osmc[0].pwm, 358);
  host.command("P:1000,1");
  host.command("Z:1;P:50,1");
  EXPECT_TRUE(board.outputs().stepper[0].enabled);
  EXPECT_EQ(board.outputs().stepper[0].position, 50);
  host.command("P:60,1;Z:1");
  EXPECT_FALSE(board.outputs().stepper[0].enabled);
}

// The second move begins at the new zero. Otherwise a later command would begin it.
TEST_F(ApplicationGroup, MovesAStepperByTheSameStepsAgain) {
  for (int moves = 0; moves < 3; ++moves) {
    const int applied = board.hal.applied;
    host.command("Z:1;P:200,500,1");
    EXPECT_EQ(board.hal.applied, applied + 1);
  }
  const int applied = board.hal.applied;
  board.run(100);
  EXPECT_EQ(board.hal.applied, applied);
}

}  // namespace
}  // namespace r4
