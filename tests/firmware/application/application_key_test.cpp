// SPDX-License-Identifier: GPL-3.0-or-later
// A board with a key: which hosts it obeys, its answers, and its heartbeats.
#include <gtest/gtest.h>

#include "tests/firmware/board_fixture.hpp"
#include "tests/support/signing.hpp"

namespace r4 {
namespace {

using firmware::BoardState;
using test::another_session;
using test::Heard;
using test::key_of;
using test::our_session;
using test::settings_with;
using test::TestBoard;
using Lines = std::vector<std::string>;

const Key key = key_of(1);

class KeyHost {
 public:
  explicit KeyHost(TestBoard& to, const Key& its_key = key, Source place = {0, 7})
      : board(to), at(place), key_(its_key) {}

  // Reads the nonce and T of the newest heartbeat.
  void listen() {
    for (const test::MemoryPort::Sent& sent : board.ports[at.port].sent) {
      Datagram datagram;
      if (!read_datagram(sent.bytes, datagram) || kind_of(datagram) != MessageKind::board_heartbeat)
        continue;
      nonce = test::str(heartbeat_nonce(datagram));
      t = static_cast<std::uint32_t>(datagram.time_ms());
      echo = is_connecting_heartbeat(datagram) ? 0 : t;
    }
  }
  std::string fields(const std::string& field, std::uint64_t time) {
    return field + ";" + test::stamp_of(our_session, pnum++, time);
  }
  std::string signed_fields(const std::string& text) {
    return test::with_signature(text, key_, nonce, ++counter, board.now_ms);
  }
  std::string heartbeat() {
    listen();
    last = signed_fields(fields("H:ROS2-R4", echo));
    board.receive(last, at);
    return last;
  }
  std::uint32_t command(const std::string& field) {
    last = signed_fields(fields(field, 1699276044383));
    board.receive(last, at);
    return pnum - 1;
  }
  void connect() {
    heartbeat();
    heartbeat();
  }

  TestBoard& board;
  Source at;
  std::uint32_t pnum = 12345;
  std::uint64_t counter = 1000;
  std::string nonce;
  std::uint32_t t = 0;
  std::uint32_t echo = 0;
  std::string last;

 private:
  Key key_;
};

class ApplicationKey : public testing::Test {
 protected:
  ApplicationKey() {
    board.run(600);
    host.listen();
  }
  std::uint16_t pwm() const { return board.outputs().osmc[0].pwm; }

  TestBoard board{settings_with(key), 2};
  KeyHost host{board};
};

TEST_F(ApplicationKey, SendsItsNonceAndItsTimeInEveryHeartbeat) {
  const std::vector<Heard> heard = board.take();
  ASSERT_EQ(heard.size(), 2U);
  EXPECT_EQ(heard[1].bytes, test::with_crc("H:R4-ROS2;PNum:0;T:500500;AN:" + host.nonce + ";"));
  host.connect();
  const std::vector<Heard> active = board.take(MessageKind::board_heartbeat);
  ASSERT_FALSE(active.empty());
  EXPECT_NE(active[0].bytes.find(";AN:" + host.nonce + ";^"), std::string::npos);
  EXPECT_NE(active[0].pnum, 0U);
}

TEST_F(ApplicationKey, ObeysAHostThatSigns) {
  host.connect();
  EXPECT_EQ(board.state(), BoardState::active);
  host.command("O:358,1,1");
  EXPECT_EQ(pwm(), 358);
  EXPECT_EQ(board.log.rejected, Lines());
}

TEST_F(ApplicationKey, IgnoresAHostThatDoesNotSign) {
  board.take();
  board.receive("H:ROS2-R4;" + test::stamp_of(our_session, 1, 0));
  EXPECT_EQ(board.state(), BoardState::connecting);
  board.receive("O:358,1,1;" + test::stamp_of(our_session, 2, 0));
  EXPECT_TRUE(board.safe());
  EXPECT_EQ(board.log.rejected, (Lines{"missing", "missing"}));
  EXPECT_EQ(board.log.executed, std::vector<std::uint32_t>());
}

// The board answers every such heartbeat. An attacker who sends many heartbeats cannot take the
// answer from a host that needs the nonce.
TEST_F(ApplicationKey, AnswersAnUnsignedHeartbeatWithItsNonce) {
  for (std::uint32_t peer = 90; peer < 99; ++peer) {
    board.take();
    board.receive("H:ROS2-R4;PNum:7;T:0;", {0, peer});
    const std::vector<Heard> heard = board.take(MessageKind::board_heartbeat);
    ASSERT_EQ(heard.size(), 1U);
    EXPECT_EQ(heard[0].peer, peer);
    EXPECT_NE(heard[0].bytes.find(";AN:"), std::string::npos);
  }
}

// docs/design/safety-argument.md: with a forged address, an attacker can make the board send to
// that address at most five times the bytes of the attack.
TEST_F(ApplicationKey, AnswersWithAtMostFiveTimesTheBytes) {
  host.connect();
  std::size_t longest = 0;
  for (const char* fields : {"E:STOP;", "H:ROS2-R4;PNum:1;T:0;", "H:ROS2-R4;", "X;PNum:1;T:0;",
                             "X:1;PNum:1;", "O:1,1,1;PNum:1;T:0;"}) {
    board.take();
    board.receive(fields, {0, 99});
    std::size_t bytes = 0;
    for (const Heard& heard : board.take()) bytes += heard.peer == 99 ? heard.bytes.size() : 0;
    EXPECT_LE(bytes, 5 * test::with_crc(fields).size()) << fields;
    longest = std::max(longest, 100 * bytes / test::with_crc(fields).size());
  }
  std::printf("answers have at most %zu %% of the bytes\n", longest);
  EXPECT_GT(longest, 100U);
}

TEST_F(ApplicationKey, AnswersAnUnsignedCommandWithAuth) {
  host.connect();
  for (const char* command : {"O:1,1,1;", "nonsense:1;O:x;"}) {
    board.take();
    board.receive(command + std::string("PNum:7;T:0;"), {0, 99});
    const std::vector<Heard> nacks = board.take(MessageKind::nack);
    ASSERT_EQ(nacks.size(), 1U);
    EXPECT_EQ(nacks[0].bytes.find("N:7,AUTH;"), 0U) << nacks[0].bytes;
  }
}

// docs/reference/protocol.md 4.2: the T of a CONNECTING heartbeat is only for the signature. A host
// does not echo this T.
TEST_F(ApplicationKey, AnEchoOfAConnectingHeartbeatStartsNoSession) {
  for (int i = 0; i < 20; ++i) {
    host.listen();
    ASSERT_NE(host.t, 0U);
    ASSERT_EQ(host.echo, 0U);
    board.run(1);
    board.receive(host.signed_fields(host.fields("H:ROS2-R4", host.t)), host.at);
    EXPECT_EQ(board.state(), BoardState::connecting);
    board.take();
    board.run(100);
  }
  EXPECT_EQ(board.log.rejected, Lines()) << "the signatures are valid";
  host.connect();
  EXPECT_EQ(board.state(), BoardState::active);
}

TEST_F(ApplicationKey, AForgedHeartbeatDoesNotKeepTheLinkAlive) {
  host.connect();
  host.command("O:358,1,1");
  for (int i = 0; i < 11; ++i) {
    board.run(100);
    host.listen();
    board.receive(host.fields("H:ROS2-R4", host.echo), host.at);
  }
  EXPECT_EQ(board.reason(), SafeReason::link);
  EXPECT_TRUE(board.safe());
}

TEST_F(ApplicationKey, AReplayFromAnyPeerHasNoEffect) {
  host.connect();
  host.command("O:358,1,1");
  const std::string command = host.last;
  const std::string heartbeat = host.heartbeat();
  host.command("O:0,1,1");
  board.take();
  board.take(1);
  for (const Source from : {host.at, Source{0, 99}, Source{1, 7}}) {
    board.receive(command, from);
    board.receive(heartbeat, from);
    board.receive(command, from);
  }
  EXPECT_EQ(pwm(), 0);
  EXPECT_EQ(board.log.executed.size(), 2U);
  EXPECT_EQ(board.log.rejected, Lines(9, "replayed"));
  board.run(1000);
  ASSERT_EQ(board.reason(), SafeReason::link) << "replays do not keep the link alive";
}

TEST_F(ApplicationKey, RejectsCommandsDelayedByMoreThan250Ms) {
  host.connect();
  const std::string late = host.signed_fields(host.fields("O:358,1,1", 1));
  board.run(250);
  host.heartbeat();
  board.run(1);
  board.receive(late, host.at);
  EXPECT_TRUE(board.safe());
  const std::string later = host.signed_fields(host.fields("O:358,1,1", 1));
  board.run(251);
  board.receive(later, host.at);
  EXPECT_TRUE(board.safe());
  EXPECT_EQ(board.log.rejected, (Lines{"old", "old"}));
}

TEST_F(ApplicationKey, ACommandSignedTwiceIsExecutedOnce) {
  host.connect();
  const std::uint32_t pnum = host.pnum++;
  const std::string text = "O:358,1,1;" + test::stamp_of(our_session, pnum, 5);
  board.receive(host.signed_fields(text), host.at);
  board.receive(host.signed_fields(text), host.at);
  EXPECT_EQ(board.log.executed, std::vector<std::uint32_t>{pnum});
  EXPECT_EQ(board.log.refused, Lines{std::to_string(pnum) + " DUPLICATE"});
}

TEST_F(ApplicationKey, AStopNeedsNoSignature) {
  host.connect();
  host.command("O:358,1,1");
  board.receive("E:STOP;", {0, 99});
  EXPECT_TRUE(board.safe());
  EXPECT_EQ(board.reason(), SafeReason::stop);
  EXPECT_EQ(board.log.rejected, Lines());
}

TEST_F(ApplicationKey, AnUnsignedStopConfirmsNoCommand) {
  host.connect();
  const std::uint32_t executed = host.command("O:358,1,1");
  // The stop has the number of a command that the board has not received.
  const std::uint32_t held_back = host.pnum++;
  board.receive("E:STOP;" + test::stamp_of(our_session, held_back, 0), host.at);
  EXPECT_EQ(board.reason(), SafeReason::stop);
  EXPECT_EQ(board.application->link().last_executed(), executed);
  host.heartbeat();
  const std::uint32_t stop = host.command("E:STOP");
  EXPECT_EQ(board.application->link().last_executed(), stop) << "a signed stop is a command";
}

TEST_F(ApplicationKey, ASignedStopIsANewCauseAfterAForgedStop) {
  host.connect();
  const std::uint32_t next = host.pnum + 1;
  board.receive("E:STOP;" + test::stamp_of(our_session, next, 0), host.at);
  host.heartbeat();
  const std::string clear = "E:CLEAR," + std::to_string(board.newest_cause());
  ASSERT_EQ(host.pnum, next);
  host.command("E:STOP");
  host.command(clear);  // `clear` is older than the stop
  EXPECT_EQ(board.reason(), SafeReason::stop);
}

TEST_F(ApplicationKey, ADuplicateOfASignedStopIsNotANewCause) {
  host.connect();
  const std::string stop = host.signed_fields(host.fields("E:STOP", host.pnum++));
  board.receive(stop, host.at);
  const std::int32_t cause = board.newest_cause();
  board.receive(stop, host.at);  // the signature has the previous nonce
  board.receive(stop.substr(0, stop.find("A:")), host.at);
  EXPECT_EQ(board.newest_cause(), cause);
}

TEST_F(ApplicationKey, OnlyASignedClearClearsAStop) {
  host.connect();
  board.receive("E:STOP;", {0, 99});
  board.run(5);
  host.heartbeat();
  const std::string clear = "E:CLEAR," + std::to_string(board.newest_cause());
  board.receive(host.fields(clear, 0), host.at);
  EXPECT_EQ(board.reason(), SafeReason::stop);
  host.command(clear);
  EXPECT_EQ(board.reason(), SafeReason::none);
}

TEST_F(ApplicationKey, AnswersIdentifyWithoutASignature) {
  board.take();
  board.receive("Q:ID;PNum:1;T:0;", {0, 99});
  EXPECT_EQ(board.take(MessageKind::identity).size(), 1U);
  EXPECT_EQ(board.log.rejected, Lines());
}

TEST_F(ApplicationKey, ChangesItsNonceForEachCauseOfTheSafeState) {
  host.connect();
  const std::string first = host.nonce;
  const std::string before = host.signed_fields(host.fields("O:358,1,1", 1));
  board.hal.inputs.handle = Handle::released;
  board.run(20);
  board.hal.inputs.handle = Handle::held;
  board.run(20);
  ASSERT_EQ(board.reason(), SafeReason::none);
  board.receive(before, host.at);
  EXPECT_TRUE(board.safe()) << "it was signed before the handle was released";
  host.heartbeat();
  EXPECT_NE(host.nonce, first);
  host.command("O:358,1,1");
  EXPECT_EQ(pwm(), 358);
}

TEST_F(ApplicationKey, TheBoardsOwnCableNeedsNoSignatureAndCanSetKeys) {
  board.ports[1].cable = true;
  test::TestHost cable(board, our_session, {1, 0});
  cable.connect();
  cable.command("O:358,1,1");
  EXPECT_EQ(pwm(), 358);
  cable.command("C:key,1:off");
  EXPECT_FALSE(board.application->authentication().required());
  EXPECT_EQ(board.log.refused, Lines());
}

TEST_F(ApplicationKey, RefusesToSetAKeyOverANetworkEvenIfSigned) {
  host.connect();
  const std::uint32_t pnum = host.command("C:key,1:off");
  EXPECT_EQ(board.log.refused, Lines{std::to_string(pnum) + " AUTH"});
  EXPECT_TRUE(board.application->authentication().required());
}

TEST(ApplicationWithoutKey, RequiresASignatureAsSoonAsAKeyIsSet) {
  TestBoard board({}, 2);
  board.ports[0].cable = true;
  test::TestHost cable(board, our_session);
  cable.connect();
  cable.command("C:key,1:" + std::string(64, 'a'));
  board.take();
  board.take(1);
  board.run(600);
  const std::vector<Heard> heard = board.take(MessageKind::board_heartbeat, 1);
  ASSERT_FALSE(heard.empty());
  EXPECT_NE(heard.back().bytes.find(";AN:"), std::string::npos);
  board.run(1000);
  ASSERT_EQ(board.reason(), SafeReason::link);
  test::TestHost network(board, another_session, {1, 5});
  network.connect();
  EXPECT_EQ(board.reason(), SafeReason::link);
  EXPECT_EQ(board.log.rejected.front(), "missing");
}

TEST(ApplicationWithoutKey, AcceptsASignedDatagram) {
  TestBoard board;
  test::TestHost host(board, our_session);
  host.connect();
  host.command("O:358,1,1;A:1,1,1,AAAAAAAAAAA");
  EXPECT_EQ(board.outputs().osmc[0].pwm, 358);
}

TEST(ApplicationHeartbeat, OnlyAConnectingHeartbeatHasNumberZero) {
  TestBoard board(settings_with(key));
  KeyHost host(board);
  board.run(10);
  host.connect();
  board.take();
  // Answers to other peers have their own numbers, which begin at 1.
  board.receive("H:ROS2-R4;PNum:7;T:0;", {0, 99});
  const std::vector<Heard> heard = board.take(MessageKind::board_heartbeat);
  ASSERT_EQ(heard.size(), 1U);
  EXPECT_EQ(heard[0].pnum, 1U);
}

}  // namespace
}  // namespace r4
