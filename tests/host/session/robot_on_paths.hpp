// SPDX-License-Identifier: GPL-3.0-or-later
// A host session over several paths to real boards, in virtual time with steps of a millisecond.
// Each path has its own delay. The test can cut a path in one or both directions, with or without
// notice.
#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "firmware/application/application.hpp"
#include "tests/support/driven_session.hpp"

namespace r4::test {

class RobotOnPaths final : private DrivenSession::Handler {
 public:
  struct Cable {
    Cable(std::uint32_t its_lag_ms, std::size_t its_board = 0)
        : lag_ms(its_lag_ms), board(its_board) {}
    std::uint32_t lag_ms;
    std::size_t board;
    bool listens = false;  // a bus, on which a watcher must not send questions
    bool cut_to_board = false, cut_to_host = false;
    std::string loses;              // datagrams to the board that begin with this text are lost
    std::vector<std::string> sent;  // datagrams sent by the host
    std::vector<std::string> all(char letter) const;  // the datagrams that begin with this letter
  };

  using Cables = std::vector<Cable>;

  explicit RobotOnPaths(Cables its_cables, SessionOptions options = at_will(),
                        BoardRole role = BoardRole::control, Settings settings = {});
  ~RobotOnPaths();
  static SessionOptions at_will();

  // Brings the transports of all paths up, and advances the time by half a second.
  void connect();
  void run(std::uint32_t ms);
  // The host's loop stands still. Datagrams that arrive wait until the next run().
  void stall(std::uint32_t ms);
  // The host sleeps: its clock stops, and datagrams that arrive meanwhile are lost. After waking,
  // the host's boot clock includes the sleep.
  void sleep(std::uint32_t ms);
  // Like sleep(), but as in a paused virtual machine: no clock includes the pause.
  void pause(std::uint32_t ms);
  // Cuts the path without notice, like a cable that is cut somewhere in a network.
  void cut(std::size_t path, bool is_cut = true);
  // Connects or disconnects the path. The transport reports the change.
  void plug(std::size_t path, bool in);
  // The board restarts, and its clock begins at 50 ms.
  void reboot(std::size_t board);
  // Delivers a datagram to the host as if the datagram arrived over that path.
  void bring(std::size_t path, std::string_view bytes);
  CommandResult finish(Ticket ticket, std::uint32_t most_ms = 2000);
  Ticket send(const Command& command) { return session->send(command, timeout, now()); }
  CommandResult drive(int pwm) {
    return finish(send(Command::osmc(1, Pwm(pwm), Direction::forward)));
  }

  Time now() const { return Time{(now_ms_ - slept_ms_) * 1000}; }
  std::uint32_t board_ms(std::size_t board) const;
  firmware::Application& board(std::size_t index);
  // How often each packet number was executed.
  const std::map<std::uint32_t, int>& executed(std::size_t board) const;

  static constexpr Time timeout = std::chrono::milliseconds{1000};
  Cables cables;
  std::unique_ptr<DrivenSession> session;

  std::vector<ReceivedState> states;
  bool keeps_states = true;
  std::uint32_t oldest_age_ms = 0;  // the greatest age of a state when it was reported
  std::int64_t longest_gap_ms = 0;  // between two states
  std::uint64_t told_states = 0;
  bool went_back = false;  // a reported state was older than an earlier reported state
  std::vector<LinkStatus> links;
  std::vector<Nack> nacks;
  std::map<Ticket, CommandResult> results;
  int restarts = 0;
  int trips = 0;  // how often a board changed from active to safe

 private:
  struct Board;
  struct Packet {
    std::int64_t at_ms;
    std::size_t path;
    bool to_board;
    std::string bytes;
  };
  void put(std::size_t path, bool to_board, std::string_view bytes);

  SendResult transmit(std::size_t path, std::string_view bytes, Priority priority) override;
  void on_state(const ReceivedState& state, const Datagram&) override;
  void on_nack(const Nack& nack, const Datagram&) override { nacks.push_back(nack); }
  void on_link(const LinkStatus& status) override { links.push_back(status); }
  void on_restart() override { ++restarts; }
  void on_result(Ticket ticket, const CommandResult& result) override {
    results.emplace(ticket, result);
  }

  enum class Host { runs, stalls, sleeps };
  void pass(Host host);

  std::int64_t now_ms_ = 5'000'000;
  std::int64_t slept_ms_ = 0;
  std::int64_t last_state_ms_ = 0;
  std::uint32_t last_t_ms_ = 0;
  Settings settings_;
  std::vector<std::unique_ptr<Board>> boards_;
  std::vector<bool> up_;
  std::deque<Packet> packets_;
};

struct TwoPaths : testing::Test {
  TwoPaths() { robot.connect(); }
  RobotOnPaths robot{RobotOnPaths::Cables{{1}, {1}}};
};

}  // namespace r4::test
