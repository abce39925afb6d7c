// SPDX-License-Identifier: GPL-3.0-or-later
// A session with several paths: how a path joins and leaves, and that all paths are one session.
#include "tests/firmware/host_on_paths.hpp"
#include "tests/support/signing.hpp"

namespace r4 {
namespace {

using firmware::BoardState;
using test::another_session;
using test::Heard;
using test::HostOnPaths;
using test::our_session;
using test::state_of;
using test::TestBoard;
using test::TestHost;
using Lines = std::vector<std::string>;
using Numbers = std::vector<std::uint32_t>;

constexpr Source path_a{0, 4};
constexpr Source path_b{1, 0};
constexpr Source path_c{2, 6};

struct ApplicationPaths : testing::Test {
  const SessionPaths& paths() const { return board.application->paths(); }
  // The newest state, with the counters of received datagrams.
  State newest_state(HostOnPaths& host, int port = 0) {
    host.command("F:RXLOST,RXDUP,RXREF");
    board.take(port);
    host.run(20);
    const std::vector<Heard> states = board.take(MessageKind::state, port);
    if (states.empty()) throw std::runtime_error("no state came");
    return state_of(states.back());
  }
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
    board.log.paths.clear();
  }
  static std::string heartbeat(std::uint32_t pnum, std::uint32_t t, SessionId sid = our_session) {
    return "H:ROS2-R4;" + test::stamp_of(sid, pnum, t);
  }

  TestBoard board{{}, 4};
};

// --- how a path joins

TEST_F(ApplicationPaths, APathJoinsWithAFreshEchoOfTheSession) {
  TestHost host(board, our_session, path_a);
  host.connect();
  forget();
  const std::uint32_t t = board.newest_t(0);
  const std::uint32_t pnum = host.echo();
  board.receive(heartbeat(pnum, t), path_b);
  EXPECT_EQ(board.log.paths, Lines{"joined 1/0"});
  EXPECT_EQ(paths().size(), 2);
  EXPECT_EQ(paths().joins(), 1U);
  EXPECT_EQ(answers(1), Lines());
  board.receive(heartbeat(host.pnum++, t), path_c);
  EXPECT_EQ(board.log.paths.back(), "joined 2/6") << "the number came on no other path";
  host.command("O:358,1,1");
  board.receive("O:5,1,2;" + test::stamp_of(our_session, host.pnum, 1), path_b);
  EXPECT_EQ(board.outputs().osmc[0].pwm, 358);
  EXPECT_EQ(board.outputs().osmc[1].pwm, 5) << "every path carries commands";
}

TEST_F(ApplicationPaths, ANewPathKeepsTheSessionAlive) {
  HostOnPaths host(board, {{path_a}, {path_b}});
  host.paths[1].cut = true;
  host.connect();
  host.paths[0].cut = true;
  host.paths[1].cut = false;
  board.log.states.clear();
  host.run(3000);
  EXPECT_EQ(board.log.states, Lines());
  EXPECT_EQ(paths().size(), 1);
  EXPECT_EQ(paths()[0], path_b);
}

TEST_F(ApplicationPaths, AnotherHostIsAnsweredBusyAndAddsNoPath) {
  TestHost host(board, our_session, path_a);
  host.connect();
  forget();
  const std::uint32_t t = board.newest_t(0);
  const std::uint32_t pnum = host.echo();
  for (const SessionId sid : {no_session, another_session}) {
    board.receive(heartbeat(pnum, t, sid), path_b);
    board.receive(heartbeat(pnum + 1, t, sid), path_b);
    board.receive("O:358,1,1;" + test::stamp_of(sid, host.pnum, 1), path_b);
    EXPECT_EQ(answers(1), Lines(3, "BUSY"));
    board.receive(heartbeat(pnum + 1, t, sid), path_a);
    EXPECT_EQ(answers(0), Lines(1, "BUSY")) << "also from the address of the host";
  }
  host.stay(2000);
  EXPECT_EQ(paths().size(), 1);
  EXPECT_TRUE(board.safe());
}

TEST_F(ApplicationPaths, AnOldEchoAddsNoPath) {
  TestHost host(board, our_session, path_a);
  host.connect();
  const std::uint32_t old = board.newest_t(0);
  host.stay(1100);
  forget();
  board.receive(heartbeat(host.pnum, old), path_b);
  board.receive(heartbeat(host.pnum, 0), path_b);
  board.receive(heartbeat(host.pnum, board.now_ms + 1), path_b);
  EXPECT_EQ(paths().size(), 1);
}

TEST_F(ApplicationPaths, ASessionHasAtMostFourPaths) {
  HostOnPaths host(board, {{path_a}, {path_b}, {path_c}, {Source{0, 5}}});
  host.connect();
  EXPECT_EQ(paths().size(), 4);
  forget();
  board.receive_raw(host.last, Source{3, 1});
  EXPECT_EQ(paths().size(), 4);
  EXPECT_FALSE(paths().has(Source{3, 1}));
}

TEST_F(ApplicationPaths, APaperHostHasOnePath) {
  TestHost host(board, no_session, path_a);
  host.connect();
  forget();
  const std::uint32_t t = board.newest_t(0);
  const std::uint32_t pnum = host.echo();
  board.receive(heartbeat(pnum, t, no_session), path_b);
  EXPECT_EQ(answers(1), Lines{"BUSY"});
  EXPECT_EQ(paths().size(), 1);
}

TEST_F(ApplicationPaths, AnAnswerNamesOnlyTheAskersSession) {
  HostOnPaths host(board, {{path_a}, {path_b}});
  host.connect();
  forget();
  for (const Source from : {path_a, path_c}) {
    for (const SessionId sid : {our_session, another_session, no_session}) {
      board.receive("Q:ID;" + test::stamp_of(sid, 7, 0), from);
      const std::vector<Heard> told = board.take(MessageKind::identity, from.port);
      ASSERT_EQ(told.size(), 1U);
      const bool busy = told[0].bytes.find(";BUSY:1;") != std::string::npos;
      EXPECT_EQ(busy, sid != our_session) << told[0].bytes;
      Datagram datagram;
      ASSERT_TRUE(read_datagram(told[0].bytes, datagram));
      EXPECT_EQ(datagram.session_id(), sid);
    }
  }
}

// --- commands over all paths

TEST_F(ApplicationPaths, ACommandIsExecutedOnceOverAllPaths) {
  HostOnPaths host(board, {{path_a}, {path_b}});
  host.connect();
  forget();
  const std::uint32_t both = host.command("O:358,1,1");
  host.paths[0].cut = true;
  const std::uint32_t second = host.command("Z:1");
  EXPECT_EQ(board.log.executed, (Numbers{both, second}));
  EXPECT_EQ(board.hal.zeroed, std::vector<int>{1});
  EXPECT_EQ(answers(1), Lines{"DUPLICATE"}) << "the duplicate is answered";
  EXPECT_EQ(board.log.refused, Lines()) << "a duplicate is not counted as refused";
  const State state = newest_state(host, 1);
  EXPECT_EQ(state.rx_duplicate, 0U);
  EXPECT_EQ(state.rx_refused, 0U);
  EXPECT_EQ(state.rx_lost, 0U);
}

TEST_F(ApplicationPaths, CountsADuplicateOnOnePath) {
  HostOnPaths host(board, {{path_a}, {path_b}});
  host.connect();
  host.command("Z:1");
  board.receive_raw(host.last, path_b);
  const State state = newest_state(host, 1);
  EXPECT_EQ(state.rx_duplicate, 1U);
  EXPECT_EQ(state.rx_refused, 1U);
}

TEST_F(ApplicationPaths, ADuplicateOfARefusedCommandGetsTheSameAnswer) {
  HostOnPaths host(board, {{path_a}, {path_b, 200}});
  host.connect();
  host.run(1000);
  forget();
  board.hal.inputs.handle = Handle::released;
  board.run(1);
  host.command("O:358,1,1");
  host.command("C:rate,5000");
  host.command("C:network,home");
  board.hal.inputs.handle = Handle::held;
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

// 400 commands a second: first over a slow path, then over a slow and a fast path, then over the
// fast path only. Heartbeats and commands share the numbers, so the numbers on the fast path are
// far ahead.
void expect_a_fast_path_takes_over(TestBoard& board, HostOnPaths& host, std::uint32_t lag_ms) {
  host.paths[0].cut = true;
  host.paths[1].lag_ms = lag_ms;
  host.connect();
  host.run(1000);
  ASSERT_EQ(board.state(), BoardState::active);
  board.log.states.clear();
  Numbers sent;
  for (int ms = 0; ms < 6000; ms += 10) {
    if (ms == 1000) host.paths[0].cut = false;
    if (ms == 3000) host.paths[1].cut = true;
    if (ms == 2000) board.log.executed.clear();
    for (int channel = 1; channel <= 4; ++channel) {
      const std::string end = ",1," + std::to_string(channel);
      const std::uint32_t number = host.command("O:" + std::to_string(ms / 2) + end);
      if (ms >= 2000) sent.push_back(number);
    }
    host.run(10);
  }
  EXPECT_EQ(board.log.states, Lines()) << "the board stays active";
  EXPECT_EQ(board.log.executed, sent) << "each command at once, and exactly once";
  EXPECT_EQ(board.application->paths()[0], path_a);
}

TEST_F(ApplicationPaths, AFastPathTakesOverFromALaggingPathAtAnyCommandRate) {
  HostOnPaths host(board, {{path_a}, {path_b}});
  expect_a_fast_path_takes_over(board, host, 500);
}

// --- a board with a key

class ApplicationPathsWithAKey : public testing::Test {
 protected:
  ApplicationPathsWithAKey() {
    host.seal = [this](const std::string& fields) {
      return test::with_signature(fields, key, nonce(), ++counter, board.now_ms);
    };
    board.run(10);
    host.connect();
  }
  std::string nonce() { return test::str(board.application->authentication().nonce()); }
  const SessionPaths& paths() const { return board.application->paths(); }

  const Key key = test::key_of(1);
  std::uint64_t counter = 1000;
  TestBoard board{test::settings_with(test::key_of(1)), 4};
  HostOnPaths host{board, {{path_a}, {path_b, 100}}};
};

TEST_F(ApplicationPathsWithAKey, ACommandSignedForEachPathIsExecutedOnce) {
  host.run(1000);
  EXPECT_EQ(board.state(), BoardState::active);
  ASSERT_EQ(paths().size(), 2);
  board.log.rejected.clear();
  for (int i = 0; i < 200; ++i) {
    host.paths[0].cut = i % 10 == 0;  // sometimes only the slower path carries a command
    host.command("Z:1");
    host.paths[0].cut = false;
    host.run(10);
  }
  EXPECT_EQ(board.log.rejected, Lines());
  EXPECT_EQ(board.hal.zeroed.size(), 180U) << "a command that was overtaken is stale";
  EXPECT_EQ(paths().losses(), 0U);
}

TEST_F(ApplicationPathsWithAKey, ADuplicateFromAnotherPeerIsAReplay) {
  host.command("O:358,1,1");
  const std::string command = host.last;
  host.heartbeat();
  const std::string fresh = host.last;
  host.run(150);
  board.log.rejected.clear();
  const Source attacker{3, 9};
  board.receive_raw(command, attacker);
  board.receive_raw(fresh, attacker);
  EXPECT_EQ(board.log.rejected, Lines(2, "replayed"));
  EXPECT_FALSE(paths().has(attacker));
  board.receive("O:9,1,1;" + test::stamp_of(our_session, host.pnum, 1), attacker);
  EXPECT_EQ(board.outputs().osmc[0].pwm, 358);
  EXPECT_EQ(board.log.rejected.back(), "missing") << "the SID alone proves nothing";
}

TEST_F(ApplicationPathsWithAKey, AFastPathTakesOverFromALaggingPathAtAnyCommandRate) {
  expect_a_fast_path_takes_over(board, host, 200);
}

// --- the end of paths

TEST_F(ApplicationPaths, ALostPortEndsTheLinkOnlyWithTheLastPath) {
  HostOnPaths host(board, {{path_a}, {path_b}});
  host.connect();
  host.command("O:358,1,1");
  board.application->port_down(0, board.now_ms);
  EXPECT_EQ(board.outputs().osmc[0].pwm, 358);
  EXPECT_EQ(paths().size(), 1);
  EXPECT_EQ(board.log.paths.back(), "left 0/4");
  EXPECT_EQ(board.ports[0].held, everyone);
  board.application->port_down(2, board.now_ms);  // port 2 had no path
  EXPECT_EQ(board.state(), BoardState::active);
  board.application->port_down(1, board.now_ms);
  EXPECT_EQ(board.reason(), SafeReason::link);
  EXPECT_TRUE(board.safe());
}

TEST_F(ApplicationPaths, ASessionResumesOverAnyOfItsPaths) {
  for (const std::size_t first : {0U, 1U}) {
    TestBoard fresh({}, 4);
    HostOnPaths host(fresh, {{path_a}, {path_b}});
    host.connect();
    host.command("O:358,1,1");
    host.paths[0].cut = host.paths[1].cut = true;
    host.run(1500);
    ASSERT_EQ(fresh.reason(), SafeReason::link);
    host.paths[first].cut = false;
    host.run(300);
    EXPECT_EQ(fresh.state(), BoardState::active);
    EXPECT_EQ(fresh.outputs().osmc[0].pwm, 358) << "the session is the same";
    host.command("O:7,1,1");
    EXPECT_EQ(fresh.outputs().osmc[0].pwm, 7);
    host.paths[1 - first].cut = false;
    host.run(300);
    EXPECT_EQ(fresh.application->paths().size(), 2);
  }
}

TEST_F(ApplicationPaths, AFarewellOverAllPathsIsExecutedOnce) {
  HostOnPaths host(board, {{path_a}, {path_b, 80}});
  host.connect();
  host.command("O:358,1,1");
  host.run(85);
  forget();
  const std::uint32_t leave = host.command("E:LEAVE");
  EXPECT_EQ(board.reason(), SafeReason::link);
  EXPECT_TRUE(board.safe());
  // The host has ended, but datagrams on their way arrive.
  host.paths[0].cut = host.paths[1].cut = true;
  host.run(90);
  EXPECT_EQ(board.log.executed, Numbers{leave});
  EXPECT_EQ(answers(1), Lines{"DUPLICATE"});
  EXPECT_EQ(board.reason(), SafeReason::link) << "an older heartbeat starts no session";
}

// --- the stop

TEST_F(ApplicationPaths, AStopOverAllPathsIsOneCause) {
  HostOnPaths host(board, {{path_a}, {path_b, 50}, {path_c, 90}});
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
  host.paths[0].cut = true;
  host.command("E:STOP");
  host.run(50);
  EXPECT_EQ(board.reason(), SafeReason::stop) << "a stop on any path counts";
}

// --- states and answers

TEST_F(ApplicationPaths, TwoPathsOnOnePortGetTheSameDatagrams) {
  const Source other{0, 5};
  HostOnPaths host(board, {{path_a}, {other}});
  host.connect();
  EXPECT_EQ(board.ports[0].held, path_a.peer);
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
    EXPECT_EQ(heard.peer, path_a.peer);
    EXPECT_TRUE(pnum == 0 || heard.pnum == pnum + 1) << heard.bytes;
    pnum = heard.pnum;
  }
  EXPECT_GE(at_a.size(), 50U);
  EXPECT_EQ(at_a, at_other) << "also the answers: they share the numbers of the states";
  host.paths[1].cut = true;
  host.run(1200);
  EXPECT_EQ(board.ports[0].also_held, std::vector<std::uint32_t>());
}

// An answer carries the SID of its question, and only the host of the SID's session may receive it.
TEST_F(ApplicationPaths, AnswersToAnotherHostGoOnlyToItsPath) {
  const Source other{0, 5};
  HostOnPaths host(board, {{path_a}, {other}});
  host.connect();
  forget();
  board.receive("Q:ID;" + test::stamp_of(another_session, 7, 0), path_a);
  board.receive(heartbeat(8, 0, another_session), path_a);
  int answers = 0;
  for (const Heard& heard : board.take(0)) {
    if (heard.bytes.find("SID:") == std::string::npos) continue;
    ++answers;
    EXPECT_EQ(heard.peer, path_a.peer) << heard.bytes;
  }
  EXPECT_EQ(answers, 2);
}

TEST_F(ApplicationPaths, AWatcherThatBecomesAPathNeedsNoLease) {
  TestHost host(board, our_session, path_a);
  host.connect();
  const Source place{2, 6};
  board.ports[2].bus = true;  // on a bus, a watcher needs no proof
  board.receive("W:100;PNum:1;T:0;", place);
  forget();
  board.run(100);
  EXPECT_EQ(board.take(MessageKind::state, 2).size(), 20U)
      << "its own states, and those for everyone";
  const std::uint32_t t = board.newest_t(0);
  const std::uint32_t pnum = host.echo();
  board.receive(heartbeat(pnum, t), place);
  ASSERT_EQ(paths().size(), 2);
  forget();
  board.run(100);
  const std::vector<Heard> states = board.take(MessageKind::state, 2);
  EXPECT_EQ(states.size(), 10U) << "each state once";
  for (const Heard& heard : states) EXPECT_EQ(heard.peer, place.peer);
}

}  // namespace
}  // namespace r4
