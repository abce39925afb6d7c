// SPDX-License-Identifier: GPL-3.0-or-later
// A host session in virtual time with a board whose every datagram the test writes.
#pragma once

#include <gtest/gtest.h>

#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tests/support/driven_session.hpp"

namespace r4::test {

// A command for tests that need any command.
inline const Command turn_motor = Command::osmc(1, Pwm(358), Direction::forward);

class ScriptedLink : private DrivenSession::Handler {
 public:
  // A datagram of the host.
  struct Sent {
    std::string command;  // "O:358,1,1"
    std::uint32_t pnum = 0;
    std::uint64_t t = 0;
    Priority priority = Priority::normal;
    Time at{0};
    std::string bytes;
  };

  explicit ScriptedLink(SessionOptions options = without_questions(),
                        BoardRole role = BoardRole::control);
  // Options with which the session by itself sends only heartbeats and its choice of fields, and
  // sends commands without being armed.
  static SessionOptions without_questions();
  // The same, but the session must be armed.
  static SessionOptions must_arm();

  DrivenSession session;
  Time now = std::chrono::seconds{5000};

  // Everything that the session has sent and reported, in order.
  std::vector<Sent> sent;
  std::map<Ticket, CommandResult> results;
  std::vector<LinkStatus> links;
  std::vector<ReceivedState> states;
  int restarts = 0;
  std::vector<DisarmCause> arming;
  std::vector<RefusedPost> refused;
  std::vector<ReadError> bad;
  std::vector<Nack> nacks;
  std::string board_id;

  // True if another host sends from the same place, so that the carrier takes only stops.
  bool place_taken = false;
  TransportTrouble frames = TransportTrouble::none;  // the trouble with frames on the bus

  // Lets time pass. poll() is called exactly when the session asked for it.
  void pass(Time duration);

  // The board sends. Its clock runs with the host's clock; its packet numbers count by themselves.
  void boot_heartbeat();  // H:R4-ROS2;PNum:0;T:0;
  void heartbeat(SafeReason reason = SafeReason::none);
  void stopped(std::uint32_t stop, int cause = 1);  // SAFE:2 after the E:STOP with this number
  // Fields such as "AIN24:24.28;CMD:7;". The safe reason is a field like any other.
  void state(std::string_view fields);
  void executed(std::uint32_t pnum);  // a state with SAFE 0 and this CMD
  // Addressed to the host of the session that began with heartbeat session_pnum; 0: to another
  // host.
  void nack(std::uint32_t pnum, std::string_view code);
  std::uint32_t session_pnum = 0;       // set by connect()
  SessionId host_session = no_session;  // of the host's newest datagram; answers name it
  // The answer to the host's newest question. Older boards do not name the question.
  void identity(std::string_view capabilities = "udp", bool names_question = true);
  void answer(std::uint32_t question, std::string_view capabilities = "udp");
  std::string asker() const;  // "SID:…;"
  void raw(std::string_view bytes);
  // The board restarts, with another clock and new packet numbers; nothing is sent.
  void reboot();
  std::uint32_t board_ms() const { return board_clock(); }
  std::uint32_t board_pnum = 5000;

  // Heartbeat, echo, and a confirmed F: commands can be sent after this. Clears the sent datagrams.
  void connect();

  // The host's datagrams with commands of this letter, and the newest of them.
  std::vector<Sent> all(char letter) const;
  Sent last(char letter) const;
  std::size_t count(char letter) const { return all(letter).size(); }

 private:
  std::uint32_t board_clock() const;
  void finish(std::string_view fields);

  SendResult transmit(std::size_t, std::string_view datagram, Priority priority) override;
  TransportTrouble trouble() const override { return frames; }
  void on_state(const ReceivedState& state, const Datagram&) override { states.push_back(state); }
  void on_restart() override { ++restarts; }
  void on_arming(DisarmCause cause) override { arming.push_back(cause); }
  void on_refused(const RefusedPost& post) override { refused.push_back(post); }
  void on_identity(const Identity& identity) override;
  void on_nack(const Nack& nack, const Datagram&) override { nacks.push_back(nack); }
  void on_bad_datagram(const ReadResult& result, std::string_view) override {
    bad.push_back(result.error);
  }
  void on_link(const LinkStatus& status) override { links.push_back(status); }
  void on_result(Ticket ticket, const CommandResult& result) override {
    results.emplace(ticket, result);
  }

  Time due_{0};
  std::uint32_t clock_offset_ = 77'000;
};

// A link whose session is in control of its board.
struct ConnectedLink : ScriptedLink {
  explicit ConnectedLink(SessionOptions options = without_questions())
      : ScriptedLink(std::move(options)) {
    connect();
  }
};

// A session whose board has not been heard yet.
struct NewSession : testing::Test {
  explicit NewSession(SessionOptions options = ScriptedLink::without_questions(),
                      BoardRole role = BoardRole::control)
      : link(std::move(options), role) {}
  bool under_way(Ticket ticket) const { return !link.results.contains(ticket); }
  CommandResult result(Ticket ticket) const {
    EXPECT_FALSE(under_way(ticket)) << "command " << ticket << " must have ended";
    return under_way(ticket) ? CommandResult{Outcome::none} : link.results.at(ticket);
  }
  Outcome outcome(Ticket ticket) const { return result(ticket).outcome; }

  ScriptedLink link;
};

// A session that is in control of its board.
struct ConnectedSession : NewSession {
  explicit ConnectedSession(SessionOptions options = ScriptedLink::without_questions())
      : NewSession(std::move(options)) {
    link.connect();
  }
};

}  // namespace r4::test
