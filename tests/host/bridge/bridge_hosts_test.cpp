// SPDX-License-Identifier: GPL-3.0-or-later
// The hosts that a bridge serves, and how strangers can affect them.
#include "host/bridge/bridge_hosts.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <string>
#include <vector>

#include "protocol/link/answer_budget.hpp"
#include "scripted_bridge.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;
using Texts = ScriptedBridge::Texts;

const std::string owner_sid = ";SID:00000000000000aa", other_sid = ";SID:00000000000000bb";
const std::string streamed = "AIN24:24.28;PNum:7;T:100;";
const std::string board_heartbeat = "H:R4-ROS2;PNum:8;T:101;";
const std::string free_board = "H:R4-ROS2;PNum:9;T:101;SAFE:1;";
constexpr Peer owner = 1, waiting = 2, newcomer = 3, victim = 66;

class BridgeHostsTest : public testing::Test, protected ScriptedBridge {
 protected:
  void SetUp() override {
    pair->open();
    board->say(streamed);
  }
  static std::string sid(int i) { return ";SID:00000000000001" + std::to_string(10 + i); }
  // A heartbeat that echoes the board's newest T.
  void heartbeat(const std::string& of, Peer from, int t = 100) {
    hosts->say("H:ROS2-R4" + of + ";PNum:50;T:" + std::to_string(t) + ";", from);
  }
  void paper_heartbeat(Peer from) { hosts->say("H:ROS2-R4;PNum:50;T:0;", from); }
  void command(const std::string& of, Peer from) {
    hosts->say("O:1,1,1" + of + ";PNum:51;T:0;", from);
  }
  void busy(const std::string& of) { board->say("N:50,BUSY" + of + ";PNum:8;T:101;"); }
  void begin() {
    heartbeat(owner_sid, owner);
    pass(BridgeHosts::patience);
    take();
  }
  // Drops the datagrams sent to both sides.
  void take() {
    hosts->take();
    board->take();
  }
  bool hears_states(Peer peer) {
    hosts->take();
    board->say(streamed);
    const Texts texts = hosts->take();
    return std::count(texts.begin(), texts.end(), streamed + "@" + std::to_string(peer)) == 1;
  }
};

TEST_F(BridgeHostsTest, PassesSeveralHostsAndTheBoardDecides) {
  begin();
  EXPECT_EQ(hosts->held, owner);
  heartbeat(other_sid, waiting, 0);
  command(other_sid, waiting);
  EXPECT_EQ(passed(), (Texts{"H:ROS2-R4" + other_sid + ";PNum:50;T:0;",
                             "O:1,1,1" + other_sid + ";PNum:51;T:0;"}));
  busy(other_sid);
  EXPECT_EQ(hosts->take(), Texts{"N:50,BUSY" + other_sid + ";PNum:8;T:101;@2"});
}

TEST_F(BridgeHostsTest, ServesAHostThatTheBoardDoesNotRefuseInTime) {
  heartbeat(owner_sid, owner, 0);
  pass(BridgeHosts::patience);
  EXPECT_FALSE(hears_states(owner)) << "the board does not judge a heartbeat without an echo";
  board->say("H:R4-ROS2;PNum:0;T:0;");
  heartbeat(owner_sid, owner, 1);
  pass(BridgeHosts::patience);
  EXPECT_FALSE(hears_states(owner)) << "a board without a host has sent no T to echo";
  heartbeat(owner_sid, owner);
  EXPECT_FALSE(hears_states(owner));
  pass(BridgeHosts::patience);
  EXPECT_TRUE(hears_states(owner));
  EXPECT_EQ(hosts->held, owner);
}

TEST_F(BridgeHostsTest, ServesARefusedHostAfterATimeoutWithoutRefusals) {
  begin();
  heartbeat(other_sid, waiting);
  busy(other_sid);
  for (int i = 0; i < 30; ++i) {
    pass(100ms);
    heartbeat(owner_sid, owner);
    heartbeat(other_sid, waiting);
    EXPECT_FALSE(hears_states(waiting));
    if (i % 5 == 0) busy(other_sid);  // the board does not answer every heartbeat
  }
  EXPECT_EQ(hosts->held, owner);
  EXPECT_TRUE(hosts->also_held.empty());
  pass(1s);
  heartbeat(other_sid, waiting);
  pass(BridgeHosts::patience);
  EXPECT_TRUE(hears_states(waiting));
}

TEST_F(BridgeHostsTest, IgnoresAnEarlierBusyOfABoardWithoutAHost) {
  for (const std::string& free : {free_board, std::string("H:R4-ROS2;PNum:0;T:0;")}) {
    heartbeat(other_sid, waiting);
    busy(other_sid);
    board->say(free);
    board->say(streamed);
    heartbeat(other_sid, waiting);
    pass(BridgeHosts::patience);
    EXPECT_TRUE(hears_states(waiting)) << free;
  }
}

TEST_F(BridgeHostsTest, HoldsThePeersOfTheServedHost) {
  begin();
  heartbeat(owner_sid, newcomer);
  EXPECT_EQ(hosts->held, owner);
  EXPECT_EQ(hosts->also_held, std::vector<Peer>{newcomer})
      << "the newcomer is another path of the session";
  pass(900ms);
  heartbeat(owner_sid, newcomer);
  pass(100ms);
  EXPECT_EQ(hosts->held, newcomer)
      << "the session keeps its other path when the first path is silent";
  heartbeat(other_sid, waiting);
  pass(BridgeHosts::patience);
  busy(owner_sid);
  EXPECT_EQ(hosts->held, waiting);
  pass(1s);
  EXPECT_EQ(hosts->held, everyone);
}

TEST_F(BridgeHostsTest, APaperHostKeepsItsSlotLongerThanTheBoardTimeoutDespiteStrangers) {
  paper_heartbeat(owner);
  take();
  paper_heartbeat(waiting);
  command("", waiting);
  EXPECT_EQ(passed(), Texts{});
  EXPECT_EQ(hosts->take(), Texts{"N:50,BUSY;PNum:7;T:100;@2"});
  EXPECT_EQ(from_hosts().kept_out, 2U);
  command("", owner);
  EXPECT_EQ(passed().size(), 1U);
  for (int i = 0; i < 59; ++i) {
    pass(25ms);
    heartbeat(sid(i), 100 + static_cast<Peer>(i));
  }
  take();
  paper_heartbeat(waiting);
  EXPECT_EQ(passed(), Texts{});
  pass(25ms);
  paper_heartbeat(waiting);
  EXPECT_EQ(passed().size(), 1U);
}

TEST_F(BridgeHostsTest, DropsACommandOfAHostWithoutAHeartbeat) {
  command(owner_sid, owner);
  EXPECT_EQ(passed(), Texts{});
  EXPECT_EQ(from_hosts().kept_out, 1U);
}

// --- strangers

TEST_F(BridgeHostsTest, StrangersDoNotKeepAHostOut) {
  for (const bool owned : {false, true}) {
    if (owned) begin();
    for (int ms = 0; ms < 3000; ms += 500) {
      heartbeat(owner_sid, owner);
      for (int i = 0; i < 16; ++i) {
        heartbeat(sid(i), 100 + static_cast<Peer>(i), 50000);
        if (owned) busy(sid(i));
      }
      pass(500ms);
    }
    board->take();
    heartbeat(other_sid, newcomer);
    EXPECT_EQ(passed().size(), 1U);
    pass(BridgeHosts::patience);
    EXPECT_TRUE(hears_states(newcomer));
    busy(other_sid);
  }
  EXPECT_TRUE(hears_states(owner));
  heartbeat(owner_sid, 4);
  EXPECT_TRUE(hears_states(4)) << "a served session may come from a new address";
}

TEST_F(BridgeHostsTest, SixteenServedHostsKeepTheirSlots) {
  for (int i = 0; i < 16; ++i) heartbeat(sid(i), 100 + static_cast<Peer>(i));
  pass(500ms);
  take();
  heartbeat(owner_sid, newcomer);
  EXPECT_EQ(passed(), Texts{});
  EXPECT_EQ(hosts->take(), Texts{"N:50,BUSY" + owner_sid + ";PNum:7;T:600;@3"})
      << "the answer of the bridge must name the session";
}

TEST_F(BridgeHostsTest, AServedHostReturnsAtOnceDespiteStrangers) {
  begin();
  for (int ms = 0; ms < 5000; ms += 5) {
    pass(5ms);
    heartbeat(sid(ms / 5 % 80), 100 + static_cast<Peer>(ms), 50000);
  }
  take();
  heartbeat(owner_sid, 1000);
  EXPECT_EQ(passed().size(), 1U);
  EXPECT_TRUE(hears_states(1000));
}

TEST_F(BridgeHostsTest, AFloodOfAnUnservedHostDoesNotReachTheBoard) {
  begin();
  heartbeat(other_sid, waiting);
  busy(other_sid);
  pass(1s);
  heartbeat(owner_sid, owner);
  take();
  std::size_t of_owner = 0, of_other = 0;
  for (int i = 0; i < 1000; ++i) {
    heartbeat(other_sid, waiting);
    busy(other_sid);
    command(other_sid, waiting);
    hosts->say("Q:ID" + other_sid + ";PNum:52;T:0;", waiting);
    of_other += passed().size();
    command(owner_sid, owner);
    of_owner += passed().size();
  }
  EXPECT_EQ(of_owner, 1000U);
  EXPECT_EQ(of_other, AnswerBudget::burst);
}

TEST_F(BridgeHostsTest, AnAnswerToAnUnservedHostGoesOnlyToTheAskingPeer) {
  begin();
  for (Peer peer = 100; peer < 110; ++peer) {
    pass(20ms);
    heartbeat(other_sid, peer);
    busy(other_sid);
  }
  hosts->take();
  hosts->say("O:1,1,1" + other_sid + ";PNum:60;T:0;", 105);
  board->say("N:60,BUSY" + other_sid + ";PNum:8;T:101;");
  EXPECT_EQ(hosts->take(), Texts{"N:60,BUSY" + other_sid + ";PNum:8;T:101;@105"});
}

TEST_F(BridgeHostsTest, ARefusalForThePaperHostGoesToItDespiteOtherPeers) {
  paper_heartbeat(owner);
  pass(BridgeHosts::patience);
  hosts->say("Q:ID;PNum:51;T:0;", waiting);
  command("", owner);
  hosts->take();
  board->say("N:51,RANGE;PNum:8;T:101;");
  EXPECT_EQ(hosts->take(), Texts{"N:51,RANGE;PNum:8;T:101;@1"});
}

TEST_F(BridgeHostsTest, AForgedHeartbeatSendsFewDatagramsToItsVictim) {
  for (const int ids : {1, 15}) {
    begin();
    std::size_t forged = 0, sent = 0, states = 0;
    for (int ms = 0; ms < 10000; ms += 10) {
      if (ms % 100 == 0) heartbeat(owner_sid, owner);
      for (int i = 0; ms % 990 == 0 && i < ids; ++i, ++forged) {
        heartbeat(sid(i), victim);
        busy(sid(i));
      }
      board->say(streamed);
      if (ms % 500 == 0) board->say(board_heartbeat);
      for (const std::string& text : hosts->take()) {
        if (!text.ends_with("@66")) continue;
        ++sent;
        states += text.starts_with("AIN24") ? 1 : 0;
      }
      board->take();
      pass(10ms);
    }
    EXPECT_EQ(states, 0U) << ids;
    EXPECT_LE(sent, 3 * forged) << ids;
  }
}

TEST_F(BridgeHostsTest, APeerGetsEachDatagramOnce) {
  begin();
  heartbeat(other_sid, waiting);
  heartbeat(sid(0), waiting);
  pass(BridgeHosts::patience);
  hosts->take();
  board->say(board_heartbeat);
  board->say(streamed);
  EXPECT_EQ(hosts->take(), (Texts{board_heartbeat + "@1", board_heartbeat + "@2", streamed + "@1",
                                  streamed + "@2"}))
      << "a peer with two sessions gets states once";
  busy(other_sid);
  busy(sid(0));
  hosts->say("E:STOP;PNum:70;T:0;", waiting);
  hosts->take();
  board->say(board_heartbeat);
  EXPECT_EQ(hosts->take(), (Texts{board_heartbeat + "@1", board_heartbeat + "@2"}))
      << "a refused host that has stopped the board hears heartbeats";
}

TEST_F(BridgeHostsTest, APaperHostWithoutNumbersIsNotServedNextToAnotherHost) {
  begin();
  hosts->say("H:ROS2-R4;T:0;", waiting);
  EXPECT_EQ(passed().size(), 1U);
  pass(BridgeHosts::patience);
  EXPECT_FALSE(hears_states(waiting)) << "the board cannot refuse a host without numbers";
}

TEST_F(BridgeHostsTest, WaitingHostsShareTheHeartbeatBudget) {
  begin();
  std::vector<std::size_t> heard(12);
  for (int ms = 0; ms < 3000; ms += 20) {
    heartbeat(owner_sid, owner);
    const std::size_t asks = static_cast<std::size_t>(ms) / 20 % heard.size();
    heartbeat(sid(static_cast<int>(asks)), 100 + static_cast<Peer>(asks));
    busy(sid(static_cast<int>(asks)));
    hosts->take();
    board->say(board_heartbeat);
    for (const auto& sent : hosts->sent) {
      if (sent.to >= 100) ++heard[sent.to - 100];
    }
    pass(20ms);
  }
  EXPECT_GE(*std::min_element(heard.begin(), heard.end()), 6U);
}

}  // namespace
}  // namespace r4::test
