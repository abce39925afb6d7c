// SPDX-License-Identifier: GPL-3.0-or-later
#include <chrono>
#include <utility>

#include "r4link/commissioning/board_under_test.hpp"
#include "r4link/error.hpp"

namespace r4::commissioning {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t states_kept = 6000;  // a minute at 100 Hz
constexpr BoardUnderTest::Duration supervision = 500ms;
constexpr BoardUnderTest::Duration answer_time = 1s;
constexpr BoardUnderTest::Duration scan_answer = 2s;
constexpr BoardUnderTest::Duration patience = 10s;  // for a board that restarts

}  // namespace

BoardOnLink::BoardOnLink(Board& board, std::vector<std::string> others)
    : board_(board), others_(std::move(others)), states_(board.states({.most = states_kept})) {}

void BoardOnLink::wait_heard() {
  const auto end = std::chrono::steady_clock::now() + patience;
  while (!is_heard(board_.link().state)) {
    if (std::chrono::steady_clock::now() >= end) throw Error(explain(board_.name(), board_.link()));
    states_.take(200ms);
  }
}

std::optional<ReceivedState> BoardOnLink::next_state(Duration timeout) {
  if (supervised_ && !silent_) {
    const auto now = std::chrono::steady_clock::now();
    // Does not feed, because heartbeats could make the board restore its outputs.
    if (now - fed_ > supervision) {
      throw Error(ErrorKind::refused, board_.name(), "this program did not run during a movement",
                  "resume");
    }
    fed_ = now;
    board_.feed();
  }
  return states_.take(timeout);
}

void BoardOnLink::forget_states() {
  while (states_.take(Duration(0))) {
  }
}

LinkStatus BoardOnLink::link() { return board_.link(); }
BoardIdentity BoardOnLink::identify() { return board_.identify(answer_time); }
BoardWiring BoardOnLink::wiring() { return board_.wiring(answer_time); }
void BoardOnLink::give_wiring(const Wiring& wiring) { board_.give_wiring(wiring, answer_time); }
std::vector<std::uint8_t> BoardOnLink::scan() { return board_.i2c().scan(scan_answer); }
void BoardOnLink::send(const Command& command, Duration timeout) { board_.send(command, timeout); }
void BoardOnLink::arm() { board_.arm(answer_time); }
void BoardOnLink::stop() { board_.stop(answer_time); }

void BoardOnLink::supervise(bool supervised) {
  supervised_ = supervised;
  set_watchdog();
}

void BoardOnLink::be_silent(bool silent) {
  silent_ = silent;
  set_watchdog();
}

// If the application watchdog is not fed, the heartbeats end.
void BoardOnLink::set_watchdog() {
  fed_ = std::chrono::steady_clock::now();
  board_.watchdog(silent_ ? Duration(1) : supervised_ ? supervision : Duration(0));
}

std::vector<std::string> BoardOnLink::transports() {
  std::vector<std::string> all{board_.name()};
  all.insert(all.end(), others_.begin(), others_.end());
  return all;
}

BoardUnderTest::Quality BoardOnLink::measure(std::size_t transport, Duration time) {
  const auto measured = [time](Board& board) {
    const Statistics before = board.statistics();
    const auto end = std::chrono::steady_clock::now() + time;
    while (std::chrono::steady_clock::now() < end) board.next_state(answer_time);
    const Statistics after = board.statistics();
    Quality quality;
    const auto states = static_cast<double>(after.states - before.states);
    const auto lost = static_cast<double>(after.packets.lost - before.packets.lost);
    quality.states_a_second = states / std::chrono::duration<double>(time).count();
    quality.loss = states + lost > 0 ? lost / (states + lost) : 0;
    quality.round_trip_ms = after.round_trip_mean_us / 1000;
    return quality;
  };
  if (transport == 0) return measured(board_);
  BoardOptions options;
  options.role = BoardRole::watch;
  Board other(others_.at(transport - 1), options);
  other.wait_active(patience);
  return measured(other);
}

void BoardOnLink::stop_over(std::size_t transport) {
  if (transport == 0) return board_.stop(answer_time);
  BoardOptions options;
  options.role = BoardRole::watch;
  Board(others_.at(transport - 1), options).stop(answer_time);
}

}  // namespace r4::commissioning
