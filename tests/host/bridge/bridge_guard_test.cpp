// SPDX-License-Identifier: GPL-3.0-or-later
// The datagrams that pass a bridge to a board with a key, or to a board that accepts commands from
// its cable without a key.
#include "host/bridge/bridge_guard.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <string>

#include "scripted_bridge.hpp"
#include "tests/support/signing.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;
using Texts = ScriptedBridge::Texts;

constexpr Peer keyholder = 1, second_host = 2;
const std::string nonce = "0123456789abcdef";
const std::string board_with_key = "H:R4-ROS2;PNum:3;T:5000;SAFE:1;AN:" + nonce + ";";
const std::string board_without_key = "H:R4-ROS2;PNum:3;T:5000;SAFE:1;";

// A bridge with these keys. The board has reported whether it has a key.
struct GuardedBridge : ScriptedBridge {
  GuardedBridge(std::vector<Key> keys, bool trusted, const std::string& heard)
      : ScriptedBridge(std::move(keys), trusted) {
    pair->open();
    if (!heard.empty()) board->say(heard);
    hosts->take();
  }
  static std::string sign(const std::string& fields, std::uint64_t counter, std::uint32_t t = 5000,
                          const Key& key = key_of(3)) {
    return with_signature(fields, key, nonce, counter, t);
  }
};

TEST(BridgeGuard, ABridgeWithAKeyPassesOnlySignedHeartbeatsAndCommands) {
  for (const bool trusted : {false, true}) {
    GuardedBridge bridge({key_of(3), key_of(5)}, trusted, board_with_key);
    bridge.hosts->say("H:ROS2-R4;PNum:1;T:0;", second_host);
    EXPECT_EQ(bridge.passed(), Texts{});
    const std::string heartbeat = GuardedBridge::sign("H:ROS2-R4;PNum:1;T:0;", 1);
    bridge.hosts->say(heartbeat, keyholder);
    EXPECT_EQ(bridge.passed(), Texts{heartbeat}) << "a signed datagram must pass unchanged";
    bridge.hosts->take();
    bridge.hosts->say("O:1,1,1;PNum:2;T:0;", keyholder);
    EXPECT_EQ(bridge.passed(), Texts{});
    EXPECT_EQ(bridge.hosts->take(), Texts{"N:2,AUTH;PNum:3;T:5000;@1"});
    const std::string command = GuardedBridge::sign("O:1,1,1;PNum:3;T:0;", 2);
    bridge.hosts->say(command, keyholder);
    EXPECT_EQ(bridge.passed(), Texts{command});
    bridge.hosts->say(GuardedBridge::sign("O:2,1,1;PNum:4;T:0;", 3, 5000, key_of(3, 9)), keyholder);
    bridge.hosts->say(command, second_host);
    EXPECT_EQ(bridge.passed(), Texts{}) << "a datagram with another key and a replay must not pass";
    bridge.hosts->say("C:key,1:off;PNum:5;T:0;", keyholder);
    bridge.hosts->say(GuardedBridge::sign("C:key,1:off;PNum:6;T:0;", 4), keyholder);
    EXPECT_EQ(bridge.passed(), Texts{});
    EXPECT_EQ(bridge.from_hosts().refused, 6U);
    bridge.hosts->say(GuardedBridge::sign("H:ROS2-R4;PNum:7;T:0;", 5, 5000, key_of(5)), keyholder);
    EXPECT_EQ(bridge.passed().size(), 1U) << "each host may have its own key";
    bridge.hosts->say("E:STOP;PNum:7;T:0;", second_host);
    bridge.hosts->say("Q:ID;PNum:8;T:0;", second_host);
    EXPECT_EQ(bridge.passed(), (Texts{"E:STOP;PNum:7;T:0;", "Q:ID;PNum:8;T:0;"}));
  }
}

TEST(BridgeGuard, DropsDatagramsSignedTooLongAgoOrForAnEarlierNonce) {
  GuardedBridge bridge({key_of(3)}, true, board_with_key);
  bridge.pass(200ms);
  bridge.hosts->say(GuardedBridge::sign("H:ROS2-R4;PNum:1;T:0;", 1), keyholder);
  EXPECT_EQ(bridge.passed().size(), 1U);
  bridge.pass(100ms);
  bridge.hosts->say(GuardedBridge::sign("H:ROS2-R4;PNum:2;T:0;", 2), keyholder);
  EXPECT_EQ(bridge.passed(), Texts{});
  bridge.hosts->say(GuardedBridge::sign("H:ROS2-R4;PNum:3;T:0;", 3, 9000), keyholder);
  EXPECT_EQ(bridge.passed(), Texts{}) << "a signature for a later time must not pass";
  bridge.board->say("H:R4-ROS2;PNum:4;T:5300;AN:fedcba9876543210;");
  bridge.hosts->say(GuardedBridge::sign("H:ROS2-R4;PNum:4;T:0;", 4, 5300), keyholder);
  EXPECT_EQ(bridge.passed(), Texts{}) << "the board has a new nonce";
}

TEST(BridgeGuard, ALateStateDoesNotSetTheBoardClockBack) {
  GuardedBridge bridge({key_of(3)}, true, board_with_key);
  bridge.pass(40ms);
  bridge.board->say("AIN24:24.28;PNum:4;T:5010;");
  bridge.hosts->say(GuardedBridge::sign("H:ROS2-R4;PNum:1;T:0;", 1, 5030), keyholder);
  EXPECT_EQ(bridge.passed().size(), 1U);
}

TEST(BridgeGuard, ABridgeWithoutAKeyPassesOnlyStopsToAKeyedBoardOnACable) {
  GuardedBridge bridge({}, true, board_with_key);
  EXPECT_EQ(bridge.events.back(), "board warning");
  bridge.hosts->say("H:ROS2-R4;PNum:1;T:0;", keyholder);
  bridge.hosts->say("O:1,1,1;PNum:2;T:0;", keyholder);
  EXPECT_EQ(bridge.passed(), Texts{});
  EXPECT_EQ(bridge.hosts->take(), Texts{"N:2,AUTH;PNum:3;T:5000;@1"});
  bridge.hosts->say("E:STOP;PNum:3;T:0;", keyholder);
  EXPECT_EQ(bridge.passed(), Texts{"E:STOP;PNum:3;T:0;"});
}

TEST(BridgeGuard, PassesNothingToACableUntilTheBoardReportsItsKey) {
  GuardedBridge bridge({}, true, "");
  bridge.hosts->say("H:ROS2-R4;PNum:1;T:0;", keyholder);
  EXPECT_EQ(bridge.passed(), Texts{});
  bridge.board->say(board_without_key);
  bridge.hosts->say("H:ROS2-R4;PNum:2;T:0;", keyholder);
  EXPECT_EQ(bridge.passed().size(), 1U);
  bridge.board->report(CarrierEvent::Kind::down);  // another board may be plugged in
  bridge.hosts->say("H:ROS2-R4;PNum:3;T:0;", keyholder);
  EXPECT_EQ(bridge.passed(), Texts{});
}

TEST(BridgeGuard, ABridgeWithoutAKeyPassesHeartbeatsToACheckingBoard) {
  GuardedBridge bridge({}, false, board_with_key);
  bridge.hosts->say("H:ROS2-R4;PNum:1;T:0;", keyholder);
  EXPECT_EQ(bridge.passed().size(), 1U);
}

TEST(BridgeGuard, ABridgeWithAKeyPassesNothingToABoardWithoutAKey) {
  GuardedBridge bridge({key_of(3)}, true, board_without_key);
  EXPECT_EQ(bridge.events.back(), "board warning");
  bridge.hosts->say("H:ROS2-R4;PNum:1;T:0;", keyholder);
  bridge.hosts->say(GuardedBridge::sign("H:ROS2-R4;PNum:2;T:0;", 1), keyholder);
  EXPECT_EQ(bridge.passed(), Texts{});
}

TEST(BridgeGuard, ARefusedHostGetsTheNonceThatItNeeds) {
  GuardedBridge bridge({key_of(3)}, true, board_with_key);
  bridge.hosts->say("H:ROS2-R4;PNum:1;T:0;", second_host);
  bridge.hosts->take();
  bridge.board->say(board_with_key);
  EXPECT_EQ(bridge.hosts->take(), (Texts{board_with_key, board_with_key + "@2"}));
}

}  // namespace
}  // namespace r4::test
