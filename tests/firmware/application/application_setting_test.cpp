// SPDX-License-Identifier: GPL-3.0-or-later
// The effect of each setting, when it begins, and how long it lasts.
#include <gtest/gtest.h>

#include <optional>

#include "r4link/wiring/wiring_value.hpp"
#include "tests/firmware/board_fixture.hpp"

namespace r4 {
namespace {

using firmware::BoardState;
using test::another_session;
using test::Heard;
using test::our_session;
using test::TestBoard;
using test::TestHost;
using Lines = std::vector<std::string>;

using ApplicationSetting = test::BoardInControl;

TEST_F(ApplicationSetting, SettingsTakeEffectAtOnce) {
  host.command("C:rate,1000");
  board.run(10);
  board.take();
  board.run(100);
  EXPECT_EQ(board.take(MessageKind::state).size(), 100U);

  host.command("C:timeout,200");
  EXPECT_EQ(answers(), Lines{"RANGE"});  // the timeout must exceed the heartbeat interval
  host.command("C:heartbeat,50");
  host.command("C:timeout,200");
  host.echo();
  board.run(1);
  host.echo();
  board.run(199);
  EXPECT_EQ(board.state(), BoardState::active);
  board.run(1);
  EXPECT_EQ(board.reason(), SafeReason::link);
}

TEST_F(ApplicationSetting, ATimeoutThatHasPassedMakesTheOutputsSafeAtOnce) {
  host.command("C:heartbeat,50");
  host.command("O:358,1,1");
  host.echo();
  board.run(200);
  host.command("C:timeout,201");
  EXPECT_EQ(board.state(), BoardState::active);
  EXPECT_EQ(board.outputs().osmc[0].pwm, 358);
  host.command("C:timeout,200");
  EXPECT_EQ(board.log.executed.size(), 4U);
  EXPECT_EQ(board.reason(), SafeReason::link);
  EXPECT_TRUE(board.safe());
}

TEST_F(ApplicationSetting, TheHeartbeatIntervalFollowsItsSetting) {
  TestHost paper(board, no_session, Source{0, 4});
  board.run(1500);
  paper.heartbeat(5);
  board.run(1);
  paper.command("C:heartbeat,90");
  board.run(200);
  board.take();
  for (int i = 0; i < 10; ++i) {
    paper.heartbeat(6);
    board.run(90);
  }
  EXPECT_EQ(board.take(MessageKind::board_heartbeat).size(), 10U);
}

TEST_F(ApplicationSetting, RecoveryFollowsItsSetting) {
  host.command("O:358,1,1");
  host.command("C:recovery,rearm");
  board.run(1500);
  host.echo();
  EXPECT_EQ(board.state(), BoardState::active);
  EXPECT_TRUE(board.safe());
}

TEST_F(ApplicationSetting, SettingsOutlastTheSession) {
  host.command("C:rate,10");
  host.command("U:30,1");
  board.run(1500);
  TestHost other(board, another_session, Source{0, 6});
  other.connect();
  EXPECT_EQ(board.application->settings().state_rate_hz, 10);
  board.hal.inputs.ultrasonic_cm[0] = 20;
  board.run(10);
  EXPECT_EQ(board.reason(), SafeReason::proximity);
}

TEST_F(ApplicationSetting, TheSettingPackTurnsThePackedFormOnAndOff) {
  EXPECT_TRUE(board.ports[0].packed);
  host.command("C:pack,0");
  EXPECT_FALSE(board.ports[0].packed);
  host.command("C:rate,50");
  EXPECT_FALSE(board.ports[0].packed);
  host.command("C:pack,1");
  EXPECT_TRUE(board.ports[0].packed);
}

// The next host may not support the packed form.
TEST_F(ApplicationSetting, ABoardWithoutAHostSendsPlainText) {
  board.run(1000);
  ASSERT_EQ(board.reason(), SafeReason::link);
  EXPECT_FALSE(board.ports[0].packed);
  host.echo();
  ASSERT_EQ(board.state(), BoardState::active);
  EXPECT_TRUE(board.ports[0].packed) << "the same host continues";
  host.command("C:pack,0");
  board.run(1000);
  host.echo();
  ASSERT_EQ(board.state(), BoardState::active);
  EXPECT_FALSE(board.ports[0].packed);

  TestBoard alone;
  EXPECT_FALSE(alone.ports[0].packed);
  TestHost first(alone, our_session, Source{0, 4});
  first.connect();
  EXPECT_TRUE(alone.ports[0].packed) << "a new session";
  alone.application->port_down(0, alone.now_ms);
  EXPECT_FALSE(alone.ports[0].packed);
}

TEST_F(ApplicationSetting, AStoppedBoardWithoutItsHostSendsPlainText) {
  host.command("E:STOP");
  EXPECT_TRUE(board.ports[0].packed);
  board.run(1000);
  EXPECT_EQ(board.reason(), SafeReason::stop);
  EXPECT_FALSE(board.ports[0].packed);
}

TEST_F(ApplicationSetting, TheNameIsSetOnlyOverTheBoardsOwnCable) {
  const auto identity = [this] {
    board.take();
    board.receive("Q:ID;", Source{0, 99});
    return board.take(MessageKind::identity).at(0).bytes;
  };
  host.command("C:name,left");
  ASSERT_EQ(board.log.refused.size(), 1U);
  EXPECT_NE(board.log.refused.back().find("AUTH"), std::string::npos);
  EXPECT_EQ(identity().find("NAME"), std::string::npos);
  board.ports[0].cable = true;
  host.command("C:name,left");
  EXPECT_EQ(board.log.executed.size(), 1U);
  EXPECT_NE(identity().find(";NAME:left;"), std::string::npos);
  host.command("C:name," + std::string(300, 'n'));
  ASSERT_EQ(board.log.refused.size(), 2U);
  EXPECT_NE(board.log.refused.back().find("RANGE"), std::string::npos);
  EXPECT_EQ(board.log.executed.size(), 1U);
  EXPECT_NE(identity().find(";NAME:left;"), std::string::npos);
  host.command("C:name,off");
  EXPECT_EQ(identity().find("NAME"), std::string::npos);
}

TEST_F(ApplicationSetting, TheWiringIsGivenAndToldOnlyOverTheBoardsOwnCable) {
  Wiring wiring = plan_wiring();
  wiring.at(SignalKind::handle).byte = 53;
  char value[max_wiring_value];
  const std::string give = "C:wiring," + test::str(write_wiring_value(wiring, value));
  const auto kept = [this] {
    board.take();
    board.receive("Q:WIRING;PNum:7;T:1;", Source{0, 99});
    const std::vector<Heard> heard = board.take(MessageKind::identity);
    Datagram datagram;
    Identity identity;
    BoardWiring told;
    if (heard.size() == 1) {
      const std::string& bytes = heard[0].bytes;
      EXPECT_TRUE(read_datagram(bytes, datagram) && read_identity(datagram, identity));
      EXPECT_TRUE(read_board_wiring(identity.wiring, told)) << bytes;
      EXPECT_EQ(identity.asked, 7U);
    }
    return heard.size() == 1 ? std::optional(told) : std::nullopt;
  };
  host.command(give);
  EXPECT_NE(board.log.refused.back().find("AUTH"), std::string::npos);
  EXPECT_FALSE(kept());
  EXPECT_NE(board.log.refused.back().find("AUTH"), std::string::npos);

  board.ports[0].cable = true;
  ASSERT_TRUE(kept());
  EXPECT_EQ(kept()->source, WiringSource::plan);
  EXPECT_EQ(kept()->wiring, plan_wiring());
  EXPECT_TRUE(kept()->in_use);
  host.command(give);
  EXPECT_EQ(board.log.executed.size(), 1U);
  EXPECT_EQ(kept()->source, WiringSource::given);
  EXPECT_EQ(kept()->wiring, wiring);
  EXPECT_FALSE(kept()->in_use) << "it counts from the next start on";
  wiring.at(SignalKind::handle).byte = 20;
  host.command("C:wiring," + test::str(write_wiring_value(wiring, value)));
  EXPECT_NE(board.log.refused.back().find("RANGE"), std::string::npos);
  EXPECT_EQ(kept()->wiring.at(SignalKind::handle).number(), 53) << "it keeps the one it had";
  board.receive("Q:ID;", Source{0, 99});
  EXPECT_EQ(board.take(MessageKind::identity).at(0).bytes.find("WIRING"), std::string::npos);
}

TEST_F(ApplicationSetting, TheNetworkIsSetOnlyOverTheBoardsOwnCable) {
  host.command("C:network,mine");
  EXPECT_EQ(board.log.refused.size(), 1U);
  EXPECT_NE(board.log.refused.back().find("AUTH"), std::string::npos);
  EXPECT_STREQ(board.application->settings().site.network, "");
  board.ports[0].cable = true;
  host.command("C:network,mine");
  EXPECT_STREQ(board.application->settings().site.network, "mine");
  host.command("C:rate,50");
  EXPECT_EQ(board.log.refused.size(), 1U);
}

}  // namespace
}  // namespace r4
