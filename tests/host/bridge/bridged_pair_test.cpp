// SPDX-License-Identifier: GPL-3.0-or-later
// The datagrams that pass a bridge, their order, and their receivers.
#include "host/bridge/bridged_pair.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <vector>

#include "scripted_bridge.hpp"
#include "tests/bench/allocations.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;
using Texts = ScriptedBridge::Texts;

constexpr char heartbeat[] = "H:ROS2-R4;SID:00000000000000aa;PNum:1;T:100;";
constexpr char paper_heartbeat[] = "H:ROS2-R4;PNum:1;T:0;";
constexpr char sid_a[] = ";SID:00000000000000aa";
constexpr char board_state[] = "AIN24:24.28;PNum:7;T:100;";
constexpr Peer first = 1, second = 2, third = 3;

class BridgedPairTest : public testing::Test, protected ScriptedBridge {
 protected:
  void SetUp() override { pair->open(); }
  // Begins with a board that streams states and with the first host.
  void begin() {
    board->say(board_state);
    hosts->say(heartbeat, first);
    pass(BridgeHosts::patience);
    hosts->take();
    passed();
  }
};

TEST_F(BridgedPairTest, PassesDatagramsUnchanged) {
  begin();
  hosts->say(paper_heartbeat, first);
  pass(BridgeHosts::patience);
  passed();
  for (const CapturedLine& line : paper_capture()) {
    Datagram datagram;
    if (!read_datagram(Text(line.bytes), datagram)) continue;
    ScriptedCarrier& from = line.from_board ? *board : *hosts;
    ScriptedCarrier& to = line.from_board ? *hosts : *board;
    from.say_bytes(line.bytes + "\r\n", line.from_board ? everyone : first);
    ASSERT_EQ(to.sent.size(), 1U) << line.bytes;
    EXPECT_EQ(to.sent.front().text, line.bytes);
    to.take();
  }
}

TEST_F(BridgedPairTest, NeverPassesACableOnlySetting) {
  begin();
  for (const char* const command :
       {"C:key,1:off", "C:network,evil", "C:password,evilevil", "C:host,10.0.0.1", "C:port,2019",
        "C:node,3", "C:name,left", "C:AIN24,50", "C:key", "O:1,1,1;C:key,1:off"}) {
    hosts->take();
    hosts->say(std::string(command) + sid_a + ";PNum:2;T:0;", first);
    EXPECT_EQ(passed(), Texts{}) << command;
    EXPECT_EQ(hosts->take(), Texts{"N:2,AUTH;SESSION:1" + std::string(sid_a) + ";PNum:7;T:150;@1"})
        << command;
  }
  EXPECT_EQ(from_hosts().refused, 10U);
  hosts->say("C:rate,50;SID:00000000000000aa;PNum:3;T:0;", first);
  EXPECT_EQ(passed(), Texts{"C:rate,50;SID:00000000000000aa;PNum:3;T:0;"});
}

TEST_F(BridgedPairTest, DropsAndCountsDamagedDatagrams) {
  begin();
  std::string damaged = with_crc("O:358,1,1;PNum:2;T:0;");
  damaged[2] = '9';
  hosts->say_bytes(damaged, first);
  hosts->say_bytes("E:STOP", first);
  damaged = with_crc(board_state);
  damaged[7] = '9';
  board->say_bytes(damaged);
  EXPECT_EQ(passed(), Texts{});
  EXPECT_EQ(hosts->take(), Texts{});
  EXPECT_EQ(from_hosts().damaged, 2U);
  EXPECT_EQ(from_board().damaged, 1U);
}

TEST_F(BridgedPairTest, DropsDatagramsInTheWrongDirection) {
  begin();
  hosts->say("H:R4-ROS2;PNum:0;T:0;", second);
  hosts->say("N:66,BUSY;PNum:0;T:0;", second);
  hosts->say(board_state, second);
  board->say(heartbeat);
  board->say("O:358,1,1;PNum:2;T:0;");
  EXPECT_EQ(passed(), Texts{});
  EXPECT_EQ(hosts->take(), Texts{});
  EXPECT_EQ(from_hosts().misdirected, 3U);
  EXPECT_EQ(from_board().misdirected, 2U);
}

TEST_F(BridgedPairTest, SendsNoHeartbeatOrCommandByItself) {
  begin();
  pass(10s);
  EXPECT_EQ(passed(), Texts{});
  EXPECT_EQ(hosts->take(), Texts{});
}

// --- the emergency stop

TEST_F(BridgedPairTest, AStopOfAnyPeerPassesAtOnceAndIsConfirmedToIt) {
  begin();
  hosts->result = SendResult::full;
  for (int i = 0; i < 1000; ++i) board->say(board_state);
  hosts->say("E:STOP;PNum:70;T:0;", third);
  ASSERT_EQ(board->sent.size(), 1U) << "the stop must leave within the call that received it";
  EXPECT_EQ(board->sent.front().priority, Priority::stop);
  EXPECT_EQ(from_hosts().stops, 1U);
  EXPECT_EQ(from_board().undelivered, 1000U);
  hosts->result = SendResult::sent;
  board->say("H:R4-ROS2;PNum:8;T:101;SAFE:2;STOP:70;");
  EXPECT_EQ(hosts->take(), (Texts{"H:R4-ROS2;PNum:8;T:101;SAFE:2;STOP:70;@1",
                                  "H:R4-ROS2;PNum:8;T:101;SAFE:2;STOP:70;@3"}))
      << "the peer that stopped the board hears the confirmation";
  pass(1s);
  board->say("H:R4-ROS2;PNum:9;T:601;SAFE:2;STOP:70;");
  EXPECT_EQ(hosts->take(), Texts{"H:R4-ROS2;PNum:9;T:601;SAFE:2;STOP:70;"});
}

TEST_F(BridgedPairTest, SendsWithThePrioritiesOfHostAndBoard) {
  begin();
  hosts->say("O:1,1,1;SID:00000000000000aa;PNum:2;T:0;", first);
  hosts->say("O:1,1,1;E:STOP;PNum:70;T:0;", third);
  ASSERT_EQ(board->sent.size(), 2U);
  EXPECT_EQ(board->sent.front().priority, Priority::normal);
  EXPECT_EQ(board->sent.back().priority, Priority::stop) << "a stop with other commands is a stop";
  board->say(board_state);
  board->say("H:R4-ROS2;PNum:8;T:101;");
  EXPECT_EQ(hosts->sent.front().priority, Priority::state);
  EXPECT_EQ(hosts->sent.back().priority, Priority::normal);
}

// --- nothing stale

TEST_F(BridgedPairTest, DropsDatagramsFromAStandstillExceptStops) {
  begin();
  pass(1s);
  sleep(500ms);
  hosts->say("H:ROS2-R4;PNum:2;T:0;", first);
  hosts->say("O:1,1,1;SID:00000000000000aa;PNum:3;T:0;", first);
  hosts->say("E:STOP;PNum:4;T:0;", first);
  hosts->drained();
  board->say(board_state);
  EXPECT_EQ(passed(), Texts{"E:STOP;PNum:4;T:0;"});
  EXPECT_EQ(hosts->take(), Texts{}) << "an old state must not pass";
  EXPECT_EQ(from_hosts().late, 2U);
  EXPECT_EQ(from_board().late, 1U);
  hosts->say(heartbeat, first);
  EXPECT_EQ(passed(), Texts{heartbeat}) << "the heartbeat came after the datagrams that had waited";
}

TEST_F(BridgedPairTest, PassesTheFirstDatagramAfterAStandstillOrAnIdleHour) {
  begin();
  sleep(500ms);
  pass(50ms);
  hosts->say("O:1,1,1;SID:00000000000000aa;PNum:5;T:0;", first);
  EXPECT_EQ(passed(), Texts{"O:1,1,1;SID:00000000000000aa;PNum:5;T:0;"});
  pass(1h);
  hosts->say(heartbeat, first);
  EXPECT_EQ(passed(), Texts{heartbeat});
}

// --- the other side

TEST_F(BridgedPairTest, WaitsForABoardThatIsNotConnected) {
  ScriptedBridge other;
  other.board->absence = Problem{ErrorKind::unsupported, "can:", "there is no such interface", ""};
  other.pair->open();
  other.hosts->say(heartbeat, first);
  EXPECT_EQ(other.from_hosts().undelivered, 1U);
  other.pass(3s);
  EXPECT_EQ(other.events, (Texts{"hosts up", "board down"})) << "the event must be reported once";
  other.board->absence.reset();
  other.pass(500ms);
  EXPECT_EQ(other.events.back(), "board up");
  other.hosts->say(heartbeat, first);
  EXPECT_EQ(other.passed(), Texts{heartbeat});
}

TEST_F(BridgedPairTest, OpenThrowsAnErrorThatWaitingCannotFix) {
  ScriptedBridge other;
  other.board->absence = Problem{ErrorKind::permission, "can:", "denied", ""};
  EXPECT_THROW(other.pair->open(), Error);
  ScriptedBridge deaf;
  deaf.hosts->absence = Problem{ErrorKind::open, "udp:", "in use", ""};
  EXPECT_THROW(deaf.pair->open(), Error);
}

TEST_F(BridgedPairTest, CountsUndeliveredAndOutdatedDatagrams) {
  begin();
  hosts->counted.tx_dropped = 5;  // states that newer states have replaced
  board->result = SendResult::full;
  hosts->say("O:1,1,1;SID:00000000000000aa;PNum:2;T:0;", first);
  EXPECT_EQ(from_hosts().undelivered, 1U);
  EXPECT_EQ(from_hosts().outdated, 0U);
  EXPECT_EQ(from_board().outdated, 5U);
}

// --- answers

TEST_F(BridgedPairTest, AnAnswerGoesToThePeerThatAsked) {
  begin();
  hosts->say("Q:ID;PNum:500;T:0;", second);
  hosts->say("Q:ID;PNum:600;T:0;", third);
  hosts->say("Q:ID;SID:00000000000000aa;PNum:3;T:0;", first);
  // Other peers ask with the number of the host's command.
  hosts->say("Q:ID;PNum:2;T:0;", second);
  hosts->say("O:1,1,1;SID:00000000000000aa;PNum:2;T:0;", first);
  hosts->say("Q:ID;PNum:2;T:0;", third);
  EXPECT_EQ(passed().size(), 6U);
  board->say("I:R4,1,id,udp;ASKED:600;PNum:8;T:101;");
  board->say("I:R4,1,id,udp;ASKED:500;PNum:9;T:101;");
  board->say("I:R4,1,id,udp;ASKED:3;SID:00000000000000aa;PNum:10;T:101;");
  board->say("N:2,RANGE;SID:00000000000000aa;PNum:11;T:101;");
  EXPECT_EQ(hosts->take(), (Texts{"I:R4,1,id,udp;ASKED:600;PNum:8;T:101;@3",
                                  "I:R4,1,id,udp;ASKED:500;PNum:9;T:101;@2",
                                  "I:R4,1,id,udp;ASKED:3;SID:00000000000000aa;PNum:10;T:101;@1",
                                  "N:2,RANGE;SID:00000000000000aa;PNum:11;T:101;@1"}));
  hosts->say("Q:ID;", second);
  board->say("I:R4,1,id,udp;PNum:12;T:101;");
  EXPECT_EQ(hosts->take(), Texts{"I:R4,1,id,udp;PNum:12;T:101;@2"})
      << "a question without a number gets an answer, too";
}

TEST_F(BridgedPairTest, DropsAnInvalidQuestionWithTheNumberOfACommand) {
  begin();
  hosts->say("Q:NO;PNum:2;T:0;", second);
  EXPECT_EQ(passed(), Texts{}) << "the board would answer N:2,UNKNOWN";
}

TEST_F(BridgedPairTest, LimitsTheDatagramsSentToUnprovenPeers) {
  begin();
  std::size_t questions = 0, leases = 0, copies = 0;
  for (int i = 0; i < 1000; ++i) {
    if (i % 25 == 0) {
      pass(25ms);
      hosts->say(heartbeat, first);
      board->say(board_state);
    }
    hosts->take();
    passed();
    hosts->say("Q:ID;PNum:" + std::to_string(1000 + i) + ";T:0;", second);
    questions += passed().size();
    hosts->say("W:50;PNum:900;T:0;", second);
    leases += hosts->take().size();
    hosts->say("E:STOP;PNum:70;T:0;", third);
    EXPECT_EQ(passed().size(), 1U) << "a stop always passes";
    board->say("H:R4-ROS2;PNum:8;T:101;SAFE:2;STOP:70;");
    copies += hosts->take().size() - 1;
  }
  for (const std::size_t count : {questions, copies}) {
    EXPECT_GE(count, 16U + 40U);
    EXPECT_LE(count, 16U + 60U);
  }
  EXPECT_GE(leases, 40U);
  EXPECT_LE(leases, 50U) << "no more than a board sends";
  hosts->say("Q:ID;SID:00000000000000aa;PNum:3;T:0;", first);
  EXPECT_EQ(passed(), Texts{"Q:ID;SID:00000000000000aa;PNum:3;T:0;"});
}

// --- watchers

// The LEASE of the only answer that was sent.
std::string lease_in(const Texts& answers) {
  const std::string& answer = answers.at(0);
  const std::size_t at = answer.find(",STALE;LEASE:");
  EXPECT_NE(at, std::string::npos) << answer;
  return answer.substr(at + 13, answer.find(";PNum") - at - 13);
}

TEST_F(BridgedPairTest, AWatcherNextToAHostGetsStatesForTwoSecondsAfterAnEcho) {
  begin();
  hosts->say("W:50;PNum:900;T:0;", second);
  const std::string token = lease_in(hosts->take());
  board->say(board_state);
  EXPECT_EQ(hosts->take(), Texts{std::string(board_state) + "@1"})
      << "the peer has not echoed its token yet";
  hosts->say("W:50;PNum:901;T:" + token + ";", third);
  hosts->take();
  hosts->say("W:50;PNum:901;T:" + token + ";", second);
  board->say(board_state);
  EXPECT_EQ(hosts->take(),
            (Texts{std::string(board_state) + "@1", std::string(board_state) + "@2"}))
      << "the token of another peer proves nothing";
  EXPECT_EQ(passed(), Texts{}) << "the board would take the W for one of the first host";
  pass(2s);
  hosts->say(heartbeat, first);
  board->say(board_state);
  EXPECT_EQ(hosts->take(), Texts{std::string(board_state) + "@1"});
}

// The newest W that the bridge has sent since the last call: the text before the packet number, and
// the packet number.
struct OwnLease {
  std::string text;
  std::string pnum;
};
OwnLease own_lease(ScriptedCarrier& board) {
  OwnLease newest;
  for (const std::string& each : board.take()) {
    const std::size_t at = each.find(";PNum:");
    if (!each.starts_with("W:")) continue;
    newest = {each.substr(0, at), each.substr(at + 6, each.find(';', at + 1) - at - 6)};
  }
  return newest;
}

TEST_F(BridgedPairTest, WatchesTheBoardItselfWhileItServesNoHost) {
  board->say("H:R4-ROS2;PNum:3;T:90;SAFE:1;");
  pass(25ms);
  const OwnLease first_one = own_lease(*board);
  EXPECT_EQ(first_one.text, "W:10");
  hosts->take();
  board->say("N:" + first_one.pnum + ",STALE;LEASE:77;PNum:4;T:100;");
  EXPECT_EQ(hosts->take(), Texts{}) << "the answer is for the bridge";
  pass(25ms);
  const Texts echoed = board->take();
  ASSERT_EQ(echoed.size(), 1U);
  EXPECT_TRUE(echoed[0].ends_with(";T:77;")) << echoed[0];
  board->say("AIN24:24.28;SAFE:1;PNum:7;T:100;");
  EXPECT_EQ(hosts->take(), Texts{}) << "no host has asked for states";
  hosts->say(heartbeat, first);
  pass(BridgeHosts::patience);
  const Texts begun = board->take();
  ASSERT_EQ(begun.size(), 2U);
  EXPECT_EQ(begun[0], heartbeat);
  EXPECT_TRUE(begun[1].starts_with("W:0;")) << "a host is served: " << begun[1];
}

TEST_F(BridgedPairTest, LetsItsOwnLeaseEndOnASharedBus) {
  board->shared = true;
  board->say("H:R4-ROS2;PNum:3;T:90;SAFE:1;");
  pass(25ms);
  ASSERT_EQ(own_lease(*board).text, "W:10");
  hosts->say(heartbeat, first);
  pass(BridgeHosts::patience);
  EXPECT_EQ(board->take(), Texts{heartbeat});
}

TEST_F(BridgedPairTest, ARefusalWithASessionGoesToItsHostNotToTheBridge) {
  begin();
  pass(2s);
  const OwnLease own = own_lease(*board);
  ASSERT_FALSE(own.pnum.empty());
  const std::string refusal = "N:" + own.pnum + ",RANGE" + sid_a + ";PNum:8;T:101;";
  hosts->say(heartbeat, first);
  hosts->take();
  board->say(refusal);
  EXPECT_EQ(hosts->take(), Texts{refusal + "@1"});
}

TEST_F(BridgedPairTest, WithoutAHostSelectsTheFieldsOfTheNewestWatcher) {
  board->say("H:R4-ROS2;PNum:3;T:90;SAFE:1;");
  hosts->take();
  hosts->say("W:50,AIN24,SAFE;PNum:900;T:0;", second);
  const std::string token = lease_in(hosts->take());
  EXPECT_EQ(passed(), Texts{}) << "the board would take the W for one of the bridge";
  hosts->say("W:50,AIN24,SAFE;PNum:901;T:" + token + ";", second);
  pass(25ms);
  EXPECT_EQ(own_lease(*board).text, "W:50,AIN24,SAFE");
  board->say("AIN24:24.28;SAFE:1;PNum:7;T:100;");
  EXPECT_EQ(hosts->take(), Texts{"AIN24:24.28;SAFE:1;PNum:7;T:100;@2"});
  hosts->say("W:50,NOTHING;PNum:902;T:0;", third);
  EXPECT_EQ(hosts->take(), Texts{"N:902,UNKNOWN;PNum:7;T:100;@3"});
}

TEST_F(BridgedPairTest, ServesAtMostFourWatchers) {
  begin();
  for (Peer peer = 11; peer <= 15; ++peer) {
    pass(20ms);
    hosts->say("W:50;PNum:900;T:0;", peer);
    hosts->say("W:50;PNum:1000;T:" + lease_in(hosts->take()) + ";", peer);
  }
  EXPECT_EQ(hosts->take(), Texts{"N:1000,BUSY;PNum:7;T:250;@15"});
  for (Peer stranger = 100; stranger < 140; ++stranger) hosts->say("E:STOP;", stranger);
  hosts->take();
  board->say(board_state);
  EXPECT_EQ(hosts->take().size(), 5U) << "a stranger must not take the place of a watcher";
}

// --- over weeks

TEST_F(BridgedPairTest, AllocatesNothingPerDatagramWithManyHosts) {
  begin();
  hosts->keeps = board->keeps = false;
  Texts of_hosts = {heartbeat,
                    "O:1,1,1;PNum:2;T:0;",
                    "Q:ID;PNum:500;T:0;",
                    "W:50;PNum:900;T:0;",
                    "E:STOP;PNum:70;T:0;",
                    "E:LEAVE;PNum:9;T:100;",
                    board_state};
  Texts of_board = {board_state, "H:R4-ROS2;PNum:8;T:101;SAFE:2;STOP:70;",
                    "N:900,STALE;LEASE:77;PNum:1;T:100;", "I:R4,1,id,udp;ASKED:500;PNum:9;T:101;",
                    heartbeat};
  for (Texts* const texts : {&of_hosts, &of_board}) {
    for (std::string& text : *texts) text = with_crc(text);
    texts->push_back("O:358,1,1;PNum:2;T:0;^0x0^");  // damaged
  }

  constexpr std::uint64_t rounds = 100'000;
  std::uint64_t stops = 0;
  const std::uint64_t before = bench::allocations_of_this_thread();
  for (std::uint64_t round = 0; round < rounds; ++round) {
    const Peer stranger = static_cast<Peer>(10 + round);
    const Peer peer = round % 2 == 0 ? first : stranger;
    const std::size_t what = round / 2 % of_hosts.size();
    if (what == 4) ++stops;
    hosts->say_bytes(of_hosts[what], peer);
    board->say_bytes(of_board[round % of_board.size()]);
    if (round % 10 == 0) {
      now += WaitingTime::tick_interval;
      pair->tick();
    }
  }
  EXPECT_EQ(bench::allocations_of_this_thread() - before, 0U);
  const BridgeCounters told = from_hosts();
  EXPECT_EQ(told.stops, stops);
  EXPECT_GT(told.passed, rounds / 10);
  EXPECT_GT(told.kept_out, rounds / 10);
  EXPECT_GT(from_board().passed, rounds / 3);
}

}  // namespace
}  // namespace r4::test
