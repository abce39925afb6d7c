// SPDX-License-Identifier: GPL-3.0-or-later
// A host that the board hears by several wires: how they join and leave, and that there is one session.
#include "tests/firmware/wired_host.hpp"
#include "tests/support/signing.hpp"

namespace r4 {
namespace {

using firmware::BoardState;
using test::echo_pnum;
using test::Heard;
using test::state_of;
using test::TestBoard;
using test::TestHost;
using test::WiredHost;
using Lines = std::vector<std::string>;
using Numbers = std::vector<std::uint32_t>;

constexpr Source wire_a{0, 4};
constexpr Source wire_b{1, 0};
constexpr Source wire_c{2, 6};

struct ApplicationWires : testing::Test {
  const SessionWires& wires() const { return board.application->wires(); }
  // … with the counters of what came.
  State newest_state(WiredHost& host, int port = 0) {
    host.command("F:RXLOST,RXDUP,RXREF");
    board.take(port);
    host.run(20);
    const std::vector<Heard> states = board.take(MessageKind::state, port);
    if (states.empty()) throw std::runtime_error("no state came");
    return state_of(states.back());
  }
  // The codes of the answers at a port.
  Lines answers(int port) {
    Lines codes;
    for (const Heard& heard : board.take(MessageKind::nack, port)) {
      Datagram datagram;
      Nack nack;
      EXPECT_TRUE(read_datagram(heard.bytes, datagram) && read_nack(datagram, nack));
      codes.push_back(test::str(name_of(nack.code)));
    }
    return codes;
  }
  void forget() {
    for (int i = 0; i < 4; ++i) board.take(i);
    board.log.refused.clear();
    board.log.executed.clear();
    board.log.wires.clear();
  }
  std::string heartbeat(std::uint32_t pnum, std::uint32_t t) {
    return "H:ROS2-R4;PNum:" + std::to_string(pnum) + ";T:" + std::to_string(t) + ";";
  }

  TestBoard board{{}, 4};
};

// --- how a wire joins

TEST_F(ApplicationWires, AWireJoinsWithACopyOfAHeartbeatOfTheSession) {
  TestHost host(board, echo_pnum, wire_a);
  host.connect();
  forget();
  const std::uint32_t t = board.newest_t(0);
  const std::uint32_t pnum = host.echo();
  board.receive(heartbeat(pnum, t), wire_b);
  EXPECT_EQ(board.log.wires, Lines{"joined 1/0"});
  EXPECT_EQ(wires().size(), 2);
  EXPECT_EQ(wires().joins(), 1U);
  EXPECT_EQ(answers(1), Lines());
  host.resend("O:358,1,1", host.pnum);
  board.receive("O:5,1,2;PNum:" + std::to_string(host.pnum + 1) + ";T:1;", wire_b);
  EXPECT_EQ(board.outputs().osmc[0].pwm, 358);
  EXPECT_EQ(board.outputs().osmc[1].pwm, 5) << "either wire brings commands";
}

TEST_F(ApplicationWires, AWireThatIsAheadJoinsWhenTheSameComesByTheSession) {
  TestHost host(board, echo_pnum, wire_a);
  host.connect();
  board.run(400);
  forget();
  const std::uint32_t fed_ms = board.application->link().fed_ms();
  const std::uint32_t t = board.newest_t(0);
  board.receive(heartbeat(host.pnum, t), wire_b);
  board.receive(heartbeat(host.pnum + 1, t), wire_b);  // so far ahead
  EXPECT_EQ(wires().size(), 1);
  EXPECT_EQ(board.application->link().fed_ms(), fed_ms) << "it feeds nothing before it has joined";
  EXPECT_EQ(answers(1), Lines()) << "nor is it told BUSY";
  host.echo();
  EXPECT_EQ(board.log.wires, Lines{"joined 1/0"});
}

TEST_F(ApplicationWires, WhoWaitsToJoinKeepsNobodyAlive) {
  WiredHost host(board, {{wire_a}, {wire_b}});
  host.wires[1].cut = true;
  host.connect();
  host.wires[0].cut = true;
  host.wires[1].cut = false;
  const std::uint32_t fed_ms = board.application->link().fed_ms();
  for (int i = 0; i < 1000 && board.reason() != SafeReason::link; ++i) host.run(1);
  EXPECT_EQ(board.log.state_ms - fed_ms, 1000U);
  host.run(200);
  EXPECT_EQ(board.state(), BoardState::active) << "and begins a session of its own then";
  EXPECT_EQ(wires()[0], wire_b);
}

TEST_F(ApplicationWires, AStrangerStaysBusyAndNeverJoins) {
  TestHost host(board, echo_pnum, wire_a);
  host.connect();
  forget();
  const std::uint32_t t = board.newest_t(0);
  const std::uint32_t pnum = host.echo();
  board.receive(heartbeat(echo_pnum + 500'000, t), wire_b);  // numbers of its own
  board.receive(heartbeat(pnum + 4097, t), wire_b);          // too far ahead
  board.receive(heartbeat(pnum, t + 1), wire_b);             // other bytes
  board.receive(heartbeat(pnum - 20, t), wire_b);
  board.receive("O:358,1,1;PNum:" + std::to_string(host.pnum) + ";T:1;", wire_b);
  EXPECT_EQ(answers(1), Lines(5, "BUSY"));
  board.receive(heartbeat(host.pnum, t + 1), wire_b);  // the next number, but other bytes
  EXPECT_EQ(answers(1), Lines());
  host.stay(2000);
  EXPECT_EQ(wires().size(), 1);
  EXPECT_TRUE(board.safe());
}

TEST_F(ApplicationWires, NoMoreThanFour) {
  WiredHost host(board, {{wire_a}, {wire_b}, {wire_c}, {Source{0, 5}}});
  host.connect();
  EXPECT_EQ(wires().size(), 4);
  forget();
  board.receive_raw(host.last, Source{3, 1});
  EXPECT_EQ(answers(3), Lines{"BUSY"});
  EXPECT_EQ(wires().size(), 4);
}

TEST_F(ApplicationWires, APaperHostHasOne) {
  TestHost host(board, 5, wire_a);
  host.connect();
  forget();
  const std::uint32_t t = board.newest_t(0);
  const std::uint32_t pnum = host.echo();
  board.receive(heartbeat(pnum, t), wire_b);
  EXPECT_EQ(answers(1), Lines{"BUSY"});
  EXPECT_EQ(wires().size(), 1);
}

TEST_F(ApplicationWires, TheIdentityTellsAWireOfTheSessionThatItIsNotBusy) {
  WiredHost host(board, {{wire_a}, {wire_b}});
  host.connect();
  forget();
  for (const Source from : {wire_a, wire_b, wire_c}) {
    board.receive("Q:ID;PNum:7;T:0;", from);
    const std::vector<Heard> told = board.take(MessageKind::identity, from.port);
    ASSERT_EQ(told.size(), 1U);
    const bool busy = told[0].bytes.find(";BUSY:1;") != std::string::npos;
    EXPECT_EQ(busy, from == wire_c) << told[0].bytes;
  }
}

// --- commands over all of them

TEST_F(ApplicationWires, ACommandIsExecutedOnceWhicheverWireBringsIt) {
  WiredHost host(board, {{wire_a}, {wire_b}});
  host.connect();
  forget();
  const std::uint32_t both = host.command("O:358,1,1");
  host.wires[0].cut = true;
  const std::uint32_t second = host.command("Z:1");
  EXPECT_EQ(board.log.executed, (Numbers{both, second}));
  EXPECT_EQ(board.hal.zeroed, std::vector<int>{1});
  EXPECT_EQ(answers(1), Lines{"DUPLICATE"}) << "its copy is answered";
  EXPECT_EQ(board.log.refused, Lines()) << "and counts as nothing refused";
  const State state = newest_state(host, 1);
  EXPECT_EQ(state.rx_duplicate, 0U);
  EXPECT_EQ(state.rx_refused, 0U);
  EXPECT_EQ(state.rx_lost, 0U);
}

TEST_F(ApplicationWires, WhatOneWireRepeatsIsCounted) {
  WiredHost host(board, {{wire_a}, {wire_b}});
  host.connect();
  host.command("Z:1");
  board.receive_raw(host.last, wire_b);
  const State state = newest_state(host, 1);
  EXPECT_EQ(state.rx_duplicate, 1U);
  EXPECT_EQ(state.rx_refused, 1U);
}

TEST_F(ApplicationWires, ACopyOfARefusedCommandIsToldTheSame) {
  WiredHost host(board, {{wire_a}, {wire_b, 200}});
  host.connect();
  host.run(1000);
  forget();
  board.hal.inputs.handle_held = false;
  board.run(1);
  host.command("O:358,1,1");
  host.command("C:rate,5000");
  host.command("C:network,home");
  board.hal.inputs.handle_held = true;
  host.run(150);
  const Lines first = answers(0);
  ASSERT_EQ(first.size(), 3U);
  EXPECT_EQ(first[0], "SAFE");
  EXPECT_EQ(first[1], "RANGE");
  EXPECT_EQ(first[2], "AUTH");
  host.run(150);
  EXPECT_EQ(answers(1), first);
  EXPECT_TRUE(board.safe());
}

// 400 commands a second over a wire that lags, then also over a fast one, then over that one only. Commands have
// numbers, too: the fast wire is far ahead.
void expect_a_fast_wire_takes_over(TestBoard& board, WiredHost& host, std::uint32_t lag_ms) {
  host.wires[0].cut = true;
  host.wires[1].lag_ms = lag_ms;
  host.connect();
  host.run(1000);
  ASSERT_EQ(board.state(), BoardState::active);
  board.log.states.clear();
  Numbers sent;
  for (int ms = 0; ms < 6000; ms += 10) {
    if (ms == 1000) host.wires[0].cut = false;
    if (ms == 3000) host.wires[1].cut = true;
    if (ms == 2000) board.log.executed.clear();
    for (int channel = 1; channel <= 4; ++channel) {
      const std::string end = ",1," + std::to_string(channel);
      const std::uint32_t number = host.command("O:" + std::to_string(ms / 2) + end);
      if (ms >= 2000) sent.push_back(number);
    }
    host.run(10);
  }
  EXPECT_EQ(board.log.states, Lines()) << "no trip";
  EXPECT_EQ(board.log.executed, sent) << "each at once, and once";
  EXPECT_EQ(board.application->wires()[0], wire_a);
}

TEST_F(ApplicationWires, AFastWireTakesOverFromOneThatLagsAtAnyRateOfCommands) {
  WiredHost host(board, {{wire_a}, {wire_b}});
  expect_a_fast_wire_takes_over(board, host, 500);
}

// --- a board with a key

class ApplicationWiresWithAKey : public testing::Test {
 protected:
  ApplicationWiresWithAKey() {
    host.seal = [this](const std::string& fields) {
      return test::with_signature(fields, key, nonce(), ++counter, board.now_ms);
    };
    board.run(10);
    host.connect();
  }
  // Of the newest heartbeat that went out.
  std::string nonce() { return test::str(board.application->authentication().nonce()); }
  const SessionWires& wires() const { return board.application->wires(); }

  const Key key = test::key_of(1);
  std::uint64_t counter = 1000;
  TestBoard board{test::settings_with(test::key_of(1)), 4};
  WiredHost host{board, {{wire_a}, {wire_b, 100}}};
};

TEST_F(ApplicationWiresWithAKey, TheSameSignedBytesComeByBothAndAreExecutedOnce) {
  host.run(1000);
  EXPECT_EQ(board.state(), BoardState::active);
  ASSERT_EQ(wires().size(), 2);
  board.log.rejected.clear();
  for (int i = 0; i < 200; ++i) {
    host.wires[0].cut = i % 10 == 0;  // now and then one brings it alone, later
    host.command("Z:1");
    host.wires[0].cut = false;
    host.run(10);
  }
  EXPECT_EQ(board.log.rejected, Lines());
  EXPECT_EQ(board.hal.zeroed.size(), 180U) << "what was overtaken on its way is stale";
  EXPECT_EQ(wires().losses(), 0U);
}

TEST_F(ApplicationWiresWithAKey, WhoRelaysAtOnceIsAWireAndNoMore) {
  host.command("O:358,1,1");
  const std::string command = host.last;
  host.heartbeat();
  const std::string fresh = host.last;
  const Source attacker{3, 9};
  board.receive_raw(command, attacker);
  EXPECT_EQ(board.log.rejected.back(), "replayed");
  board.receive_raw(fresh, attacker);
  EXPECT_TRUE(wires().has(attacker));
  host.command("O:7,1,1");
  board.receive_raw(command, attacker);
  board.receive("O:9,1,1;PNum:" + std::to_string(host.pnum) + ";T:1;", attacker);
  EXPECT_EQ(board.outputs().osmc[0].pwm, 7);
  EXPECT_EQ(board.log.rejected.back(), "missing");
  host.wires[0].cut = host.wires[1].cut = true;
  for (int i = 0; i < 11; ++i) {
    board.receive_raw(fresh, attacker);
    board.run(100);
  }
  EXPECT_EQ(board.reason(), SafeReason::link) << "it keeps nothing alive";
}

TEST_F(ApplicationWiresWithAKey, AFastWireTakesOverFromOneThatLagsAtAnyRateOfCommands) {
  expect_a_fast_wire_takes_over(board, host, 200);
}

// --- the end of wires

TEST_F(ApplicationWires, ALostPortTakesTheLinkOnlyWithTheLastWire) {
  WiredHost host(board, {{wire_a}, {wire_b}});
  host.connect();
  host.command("O:358,1,1");
  board.application->port_down(0, board.now_ms);
  EXPECT_EQ(board.outputs().osmc[0].pwm, 358);
  EXPECT_EQ(wires().size(), 1);
  EXPECT_EQ(board.log.wires.back(), "left 0/4");
  EXPECT_EQ(board.ports[0].held, everyone);
  board.application->port_down(2, board.now_ms);  // nobody was there
  EXPECT_EQ(board.state(), BoardState::active);
  board.application->port_down(1, board.now_ms);
  EXPECT_EQ(board.reason(), SafeReason::link);
  EXPECT_TRUE(board.safe());
}

TEST_F(ApplicationWires, ASessionIsResumedFromAnyOfItsWires) {
  for (const std::size_t first : {0U, 1U}) {
    TestBoard fresh({}, 4);
    WiredHost host(fresh, {{wire_a}, {wire_b}});
    host.connect();
    host.command("O:358,1,1");
    host.wires[0].cut = host.wires[1].cut = true;
    host.run(1500);
    ASSERT_EQ(fresh.reason(), SafeReason::link);
    host.wires[first].cut = false;
    host.run(300);
    EXPECT_EQ(fresh.state(), BoardState::active);
    EXPECT_EQ(fresh.outputs().osmc[0].pwm, 358) << "the same session";
    host.command("O:7,1,1");
    EXPECT_EQ(fresh.outputs().osmc[0].pwm, 7);
    host.wires[1 - first].cut = false;
    host.run(300);
    EXPECT_EQ(fresh.application->wires().losses(), 0U) << "it has the timeout to come back, too";
  }
}

TEST_F(ApplicationWires, TheFarewellByAllWiresIsObeyedOnce) {
  WiredHost host(board, {{wire_a}, {wire_b, 80}});
  host.connect();
  host.command("O:358,1,1");
  host.run(85);
  forget();
  const std::uint32_t leave = host.send("E:LEAVE", host.echo());
  EXPECT_EQ(board.reason(), SafeReason::link);
  EXPECT_TRUE(board.safe());
  host.wires[0].cut = host.wires[1].cut = true;  // it has ended; what is under way comes
  host.run(90);
  EXPECT_EQ(board.log.executed, Numbers{leave});
  EXPECT_EQ(answers(1), Lines{"DUPLICATE"});
  EXPECT_EQ(board.reason(), SafeReason::link) << "a heartbeat from before begins nothing";
}

// --- the stop

TEST_F(ApplicationWires, TheSameStopByAllWiresIsOneCause) {
  WiredHost host(board, {{wire_a}, {wire_b, 50}, {wire_c, 90}});
  host.connect();
  host.command("O:358,1,1");
  host.run(150);
  host.command("E:STOP");
  EXPECT_EQ(board.reason(), SafeReason::stop);
  const std::int32_t cause = board.newest_cause();
  host.run(200);
  EXPECT_EQ(board.newest_cause(), cause);
  host.command("E:CLEAR," + std::to_string(cause));
  host.run(200);
  EXPECT_EQ(board.state(), BoardState::active);
  host.wires[0].cut = true;
  host.command("E:STOP");
  host.run(50);
  EXPECT_EQ(board.reason(), SafeReason::stop) << "by any of them";
}

// --- what is sent

TEST_F(ApplicationWires, TwoPlacesOnOnePortGetTheSame) {
  const Source other{0, 5};
  WiredHost host(board, {{wire_a}, {other}});
  host.connect();
  EXPECT_EQ(board.ports[0].held, wire_a.peer);
  EXPECT_EQ(board.ports[0].also_held, std::vector<std::uint32_t>{other.peer});
  forget();
  host.command("X:1");
  host.command("Z:1");
  host.run(500);
  Lines at_a;
  Lines at_other;
  std::uint32_t pnum = 0;
  for (const Heard& heard : board.take(0)) {
    (heard.peer == other.peer ? at_other : at_a).push_back(heard.bytes);
    if (heard.peer == other.peer) continue;
    EXPECT_EQ(heard.peer, wire_a.peer);
    EXPECT_TRUE(pnum == 0 || heard.pnum == pnum + 1) << heard.bytes;
    pnum = heard.pnum;
  }
  EXPECT_GE(at_a.size(), 50U);
  EXPECT_EQ(at_a, at_other) << "the answers, too: they have numbers of the same count";
  host.wires[1].cut = true;
  host.run(1200);
  EXPECT_EQ(board.ports[0].also_held, std::vector<std::uint32_t>());
}

TEST_F(ApplicationWires, AWatcherBecomesAWireAndNeedsNoLeaseAnyMore) {
  TestHost host(board, echo_pnum, wire_a);
  host.connect();
  const Source place{2, 6};
  board.ports[2].bus = true;  // it need prove nothing
  board.receive("W:100;PNum:1;T:0;", place);
  forget();
  board.run(100);
  EXPECT_EQ(board.take(MessageKind::state, 2).size(), 20U) << "its own, and those for everyone";
  const std::uint32_t t = board.newest_t(0);
  const std::uint32_t pnum = host.echo();
  board.receive(heartbeat(pnum, t), place);
  ASSERT_EQ(wires().size(), 2);
  forget();
  board.run(100);
  const std::vector<Heard> states = board.take(MessageKind::state, 2);
  EXPECT_EQ(states.size(), 10U) << "each once";
  for (const Heard& heard : states) EXPECT_EQ(heard.peer, place.peer);
}

}  // namespace
}  // namespace r4
