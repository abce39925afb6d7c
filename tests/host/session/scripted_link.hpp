// SPDX-License-Identifier: GPL-3.0-or-later
// A host session in virtual time, opposite a board whose every datagram the test writes.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tests/support/driven_session.hpp"

namespace r4::test {

// What tests send that need any command.
inline const Command turn_motor = Command::osmc(358, Direction::forward, 1);

class ScriptedLink final : private DrivenSession::Handler {
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
  // Options with which the session sends nothing by itself but heartbeats and its choice of fields,
  // and sends what it is given without being armed.
  static SessionOptions without_questions();

  DrivenSession session;
  Time now = std::chrono::seconds{5000};

  // What has come of it, in order.
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

  // Does another host send from our place, so that the carrier takes nothing but stops?
  bool place_taken = false;
  TransportTrouble frames = TransportTrouble::none;  // what is wrong with those on the bus

  // Time passes; poll() is called exactly when the session asked for it.
  void pass(Time duration);

  // The board speaks. Its clock runs with the host's; its packet numbers count by themselves.
  void boot_heartbeat();  // H:R4-ROS2;PNum:0;T:0;
  void heartbeat(SafeReason reason = SafeReason::none);
  void stopped(std::uint32_t stop, int cause = 1);  // SAFE:2 of the E:STOP with that number
  // "AIN24:24.28;CMD:7;"; the safe reason is a field as any other.
  void state(std::string_view fields);
  void executed(std::uint32_t pnum);  // a state with SAFE 0 and this CMD
  // To the host of the session that began with its heartbeat session_pnum, or with 0 to another.
  void nack(std::uint32_t pnum, std::string_view code);
  std::uint32_t session_pnum = 0;       // connect() begins one
  SessionId host_session = no_session;  // of the host's newest datagram; answers name it
  // As the answer to our newest question, or of a board that does not tell which it answers.
  void identity(std::string_view capabilities = "udp", bool names_question = true);
  void answer(std::uint32_t question, std::string_view capabilities = "udp");
  std::string asker() const;  // "SID:…;"
  void raw(std::string_view bytes);
  // It begins again, with another clock and new numbers; nothing is sent.
  void reboot();
  std::uint32_t board_ms() const { return board_clock(); }
  std::uint32_t board_pnum = 5000;

  // Heartbeat, echo, our F executed: commands go out from now on. Forgets what was sent.
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
  void on_board_heartbeat(const Datagram&) override {}
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

}  // namespace r4::test
