// SPDX-License-Identifier: GPL-3.0-or-later
// A session with a key, and a session without a key whose board requires a key.
#include <gtest/gtest.h>

#include "host/session/session.hpp"
#include "r4link/link.hpp"
#include "scripted_link.hpp"
#include "tests/support/datagrams.hpp"
#include "tests/support/problems.hpp"
#include "tests/support/signing.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;

const Key key = key_of(2);
constexpr const char* nonce = "0123456789abcdef";
constexpr LinkCauses of_keys{LinkCause::board_has_no_key, LinkCause::key_needed,
                             LinkCause::key_not_taken};

SessionOptions keyed() {
  SessionOptions options = ScriptedLink::without_questions();
  options.key = key;
  options.clock_start = 1'700'000'000s;
  return options;
}

void keyed_heartbeat(ScriptedLink& link, const std::string& its_nonce = nonce,
                     const std::string& reason = "") {
  link.raw(with_crc("H:R4-ROS2;" + link.stamp() + reason + "AN:" + its_nonce + ";"));
}

void connect_keyed(ScriptedLink& link) {
  keyed_heartbeat(link);
  link.connect_after_heartbeat();
}

// For two seconds, the board sends its nonce and reports that it is booting.
void boot_with_a_key(ScriptedLink& link) {
  for (int i = 0; i < 4; ++i) {
    link.raw(
        with_crc("H:R4-ROS2;PNum:0;T:" + std::to_string(link.board_ms()) + ";AN:" + nonce + ";"));
    link.pass(500ms);
  }
}

struct SessionKey : NewSession {
  SessionKey() : NewSession(keyed()) {}
};

struct SessionWithKey : SessionKey {
  SessionWithKey() { connect_keyed(link); }
};

// The field A of a datagram; empty if there is no A.
std::string signature_of(const ScriptedLink::Sent& sent) {
  Datagram datagram;
  EXPECT_TRUE(read_datagram(sent.bytes, datagram));
  return str(datagram.find("A").values());
}

// The verdict of the board on this datagram.
Verdict verdict(const ScriptedLink& link, const ScriptedLink::Sent& sent,
                const std::string& its_nonce = nonce) {
  Datagram datagram;
  EXPECT_TRUE(read_datagram(sent.bytes, datagram));
  const std::string tag = signature_of(sent).substr(signature_of(sent).rfind(',') + 1);
  const std::string before = sent.bytes.substr(0, sent.bytes.rfind("," + tag));
  char expected[tag_size];
  write_tag(signing_key(key), Text(its_nonce), Text(before), expected);
  if (tag != std::string(expected, tag_size)) return Verdict::wrong_tag;
  Text values[4];
  EXPECT_EQ(datagram.find("A").split(values, 4), 4U);
  const std::uint32_t age =
      link.board_ms() - static_cast<std::uint32_t>(std::stoul(str(values[2])));
  return age <= 250 ? Verdict::authentic : Verdict::old;
}

TEST_F(SessionKey, GetsTheNonceByAnUnsignedHeartbeatThenSignsAll) {
  ASSERT_EQ(link.count('H'), 1U);
  EXPECT_EQ(signature_of(link.last('H')), "");
  keyed_heartbeat(link);
  EXPECT_TRUE(signature_of(link.last('H')).starts_with("2,1700005000"))
      << "the counter begins with the time since 1970: " << signature_of(link.last('H'));
  link.pass(10ms);
  EXPECT_EQ(verdict(link, link.last('H')), Verdict::authentic);
  EXPECT_EQ(verdict(link, link.last('F')), Verdict::authentic);
}

TEST_F(SessionWithKey, ARetryHasTheSameNumberAndANewSignature) {
  link.session.send(turn_motor, 1s, link.now);
  link.pass(60ms);
  const auto sent = link.all('O');
  ASSERT_EQ(sent.size(), 2U);
  EXPECT_EQ(sent[0].pnum, sent[1].pnum);
  EXPECT_EQ(sent[0].t, sent[1].t);
  EXPECT_NE(signature_of(sent[0]), signature_of(sent[1]));
  EXPECT_EQ(verdict(link, sent[1]), Verdict::authentic);
  link.executed(sent[1].pnum);
  EXPECT_EQ(link.results.begin()->second.outcome, Outcome::confirmed);
}

TEST_F(SessionWithKey, ALateHeartbeatDoesNotBringTheOldNonceBack) {
  const std::string late = link.stamp();
  keyed_heartbeat(link, "fedcba9876543210");
  link.raw(with_crc("H:R4-ROS2;" + late + "AN:" + nonce + ";"));
  link.session.send(turn_motor, 1s, link.now);
  EXPECT_EQ(verdict(link, link.last('O'), "fedcba9876543210"), Verdict::authentic);
}

TEST_F(SessionWithKey, SignsValidlyEvenAfterASilenceOfTheBoard) {
  link.pass(700ms);
  link.session.send(turn_motor, 1s, link.now);
  EXPECT_EQ(verdict(link, link.last('O')), Verdict::authentic);
}

TEST_F(SessionKey, SendsNothingUntilTheBoardHasAKey) {
  link.heartbeat();
  link.sent.clear();
  const Ticket ticket = link.session.send(turn_motor, 500ms, link.now);
  EXPECT_FALSE(link.session.post(turn_motor, link.now));
  link.session.send(Command::identify(), 500ms, link.now);
  for (int i = 0; i < 20; ++i) {
    link.pass(50ms);
    link.state("AIN24:24.28;SAFE:0;CMD:1;");
    link.heartbeat();
  }
  EXPECT_TRUE(link.sent.empty()) << link.sent.front().bytes;
  EXPECT_EQ(link.session.link().cause(), LinkCause::board_has_no_key);
  EXPECT_FALSE(link.session.in_control(link.now));
  EXPECT_EQ(link.results.at(ticket).outcome, Outcome::timed_out);
  EXPECT_NE(explain("board", link.session.link()).text().find("has no key"), std::string::npos);
  link.pass(300ms);
  keyed_heartbeat(link);
  EXPECT_FALSE(link.session.link().causes.has_any(of_keys)) << "the board has a key";
  EXPECT_EQ(verdict(link, link.last('H')), Verdict::authentic);
}

TEST_F(SessionKey, SendsAnUnsignedStopWithoutANonceOrABoardKey) {
  link.session.send(Command::stop(), 1s, link.now);
  EXPECT_EQ(signature_of(link.last('E')), "");
  link.heartbeat();
  link.sent.clear();
  const Ticket ticket = link.session.send(Command::stop(), 500ms, link.now);
  ASSERT_EQ(link.count('E'), 1U);
  EXPECT_EQ(signature_of(link.last('E')), "");
  link.stopped(link.last('E').pnum);
  EXPECT_EQ(link.results.at(ticket).outcome, Outcome::confirmed);
}

// The board may have executed the first of two signed duplicates, and refused the second.
TEST_F(SessionWithKey, ACommandMayBeConfirmedAfterAnAuth) {
  const Ticket ticket = link.session.send(turn_motor, 500ms, link.now);
  const std::uint32_t pnum = link.last('O').pnum;
  link.nack(pnum, "AUTH");
  EXPECT_TRUE(link.results.empty());
  EXPECT_EQ(link.session.link().cause(), LinkCause::key_not_taken);
  link.executed(pnum);
  EXPECT_EQ(link.results.at(ticket).outcome, Outcome::confirmed);
}

TEST_F(SessionWithKey, AnAuthForACableOnlySettingRefusesIt) {
  const Ticket ticket = link.session.send(Command::setting("node", "3"), 500ms, link.now);
  link.nack(link.last('C').pnum, "AUTH");
  EXPECT_EQ(link.results.at(ticket).outcome, Outcome::refused);
  EXPECT_FALSE(link.session.link().causes.has_any(of_keys));
}

TEST_F(SessionKey, ReportsThatTheBoardDoesNotAcceptItsKey) {
  boot_with_a_key(link);
  EXPECT_EQ(link.session.link().cause(), LinkCause::key_not_taken);
  EXPECT_EQ(link.last('H').t, 0U) << "no heartbeat was heard to echo";
  EXPECT_EQ(verdict(link, link.last('H')), Verdict::authentic);
  keyed_heartbeat(link);
  link.pass(0ms);
  EXPECT_FALSE(link.session.link().causes.has_any(of_keys));
}

// The previous host ended with a stop, so the board's cause hides whether it has a host.
TEST_F(SessionKey, ReportsThatAStoppedBoardDoesNotAcceptItsKey) {
  for (int i = 0; i < 12; ++i) {
    keyed_heartbeat(link, nonce, "SAFE:2;");
    link.pass(100ms);
  }
  EXPECT_EQ(link.session.link().cause(), LinkCause::key_not_taken);
  EXPECT_NE(explain("board", link.session.link()).text().find("signed with our key"),
            std::string::npos);
  EXPECT_FALSE(link.session.in_control(link.now));
  link.pass(1100ms);
  EXPECT_EQ(link.session.link().state, HostLinkState::lost);
  EXPECT_TRUE(link.session.link().causes.empty())
      << "the board's silence is not a sign of a wrong key";
}

TEST_F(SessionKey, AStoppedBoardThatAnswersBusyHasAnotherHost) {
  for (int i = 0; i < 30; ++i) {
    keyed_heartbeat(link, nonce, "SAFE:2;");
    link.nack(link.last('H').pnum, "BUSY");
    link.pass(100ms);
    EXPECT_FALSE(link.session.link().causes.has_any(of_keys));
  }
  EXPECT_TRUE(link.session.link().causes.has(LinkCause::busy));
}

// At the lowest rate the host sends several heartbeats between two states. None of these heartbeats
// may be treated as refused.
TEST_F(SessionWithKey, AStateASecondShowsThatAStoppedBoardAcceptsTheKey) {
  for (int i = 0; i < 10; ++i) {
    link.state("SAFE:2;CMD:0;");
    for (int j = 0; j < 10; ++j) {
      keyed_heartbeat(link, nonce, "SAFE:2;");
      link.pass(100ms);
      EXPECT_FALSE(link.session.link().causes.has_any(of_keys));
    }
  }
  for (int j = 0; j < 20; ++j) {  // the board sends no state after this
    keyed_heartbeat(link, nonce, "SAFE:2;");
    link.pass(100ms);
  }
  EXPECT_EQ(link.session.link().cause(), LinkCause::key_not_taken);
}

// The paper's release has no keys and answers no question, but obeys commands.
TEST_F(SessionKey, ABoardWithAKeyIsNotMistakenForThePaperRelease) {
  for (int i = 0; i < 30; ++i) {
    keyed_heartbeat(link);
    link.pass(100ms);
    EXPECT_FALSE(link.session.in_control(link.now));
  }
  EXPECT_GT(link.count('F'), 5U);
}

TEST_F(NewSession, FindsOutThatAKeyIsNeeded) {
  boot_with_a_key(link);
  EXPECT_EQ(link.session.link().cause(), LinkCause::key_needed);
  EXPECT_NE(explain("board", link.session.link()).text().find("--key"), std::string::npos);
  EXPECT_EQ(signature_of(link.last('H')), "");
}

TEST_F(NewSession, NeedsNoKeyOverACableOfTheBoard) {
  connect_keyed(link);
  for (int i = 0; i < 30; ++i) {
    link.pass(100ms);
    keyed_heartbeat(link);
  }
  EXPECT_FALSE(link.session.link().causes.has_any(of_keys));
}

TEST(Explain, NamesTheFixOfARefusedSetting) {
  const auto text = [](const Command& command, Refusal code) {
    return explain(command, CommandResult{Outcome::refused, code, Time{0}}, {}).text();
  };
  const Command new_key = Command::setting("key", "1:...");
  const Command node = Command::setting("node", "5");
  const Command rate = Command::setting("rate", "50");
  EXPECT_TRUE(contains(text(new_key, Refusal::range), "it holds at most 4 keys"));
  EXPECT_TRUE(contains(text(rate, Refusal::range), "1-1000"));
  EXPECT_TRUE(contains(text(new_key, Refusal::auth), "send the command over USB: serial:auto"));
  EXPECT_TRUE(contains(text(node, Refusal::auth), "send the command over USB: serial:auto"));
  EXPECT_TRUE(contains(text(rate, Refusal::auth), "--key FILE"));
  EXPECT_TRUE(contains(text(turn_motor, Refusal::auth), "--key FILE"));
}

}  // namespace
}  // namespace r4::test
