// SPDX-License-Identifier: GPL-3.0-or-later
// A host session in virtual time. The test writes every datagram of the board.
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
  // With these options the session by itself sends only heartbeats and its choice of fields, and it
  // sends commands without being armed.
  static SessionOptions without_questions();
  // Like without_questions(), but the session must be armed.
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

  // True if another host sends as the same peer, so that the carrier accepts only stops.
  bool place_taken = false;
  TransportTrouble frames = TransportTrouble::none;  // the trouble with frames on the bus

  // Advances the time, and calls poll() exactly when it is due.
  void pass(Time duration);

  // Sends a datagram of the board. The board's clock runs with the host's clock, and the board's
  // packet numbers count up.
  void boot_heartbeat();  // H:R4-ROS2;PNum:0;T:0;
  void heartbeat(SafeReason reason = SafeReason::none);
  void stopped(std::uint32_t stop, int cause = 1);  // SAFE:2 after the E:STOP with this number
  // Fields such as "AIN24:24.28;CMD:7;". The safe reason is a field of `fields`.
  void state(std::string_view fields);
  void executed(std::uint32_t pnum);                     // a state with SAFE 0 and this CMD
  void send_states(int count, std::string_view fields);  // one state every 10 ms
  // Addresses the host of the session that began with heartbeat session_pnum. 0: another host.
  void nack(std::uint32_t pnum, std::string_view code);
  std::uint32_t session_pnum = 0;       // set by connect()
  SessionId host_session = no_session;  // SID of the host's newest datagram, which answers name
  // The answer to the host's newest question. Older boards do not name the question.
  void identity(std::string_view capabilities = "udp", bool names_question = true);
  void answer(std::uint32_t question, std::string_view capabilities = "udp");
  std::string asker() const;  // "SID:…;"
  void raw(std::string_view bytes);
  // The board restarts, with another clock and new packet numbers, and sends nothing.
  void reboot();
  std::uint32_t board_ms() const;
  std::uint32_t board_pnum = 5000;
  std::string stamp();  // "PNum:…;T:…;" of the board's next datagram

  // Exchanges heartbeat and echo, and confirms F, so that commands can be sent. Clears the sent
  // datagrams.
  void connect();
  void connect_after_heartbeat();  // the test has sent the heartbeat of the board

  // The host's datagrams with commands of this letter, and the newest of them.
  std::vector<Sent> all(char letter) const;
  Sent last(char letter) const;
  std::size_t count(char letter) const { return all(letter).size(); }

 private:
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

struct ConnectedLink : ScriptedLink {
  explicit ConnectedLink(SessionOptions options = without_questions())
      : ScriptedLink(std::move(options)) {
    connect();
  }
};

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

struct ConnectedSession : NewSession {
  ConnectedSession() { link.connect(); }
};

}  // namespace r4::test
