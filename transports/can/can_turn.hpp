// SPDX-License-Identifier: GPL-3.0-or-later
// Decides which host sends on a board's command id (docs/reference/can.md, "Several hosts"). On one
// id the frames of two hosts would mix and, on real wires, drive hosts bus-off. So a host listens
// before it sends. The later host is silent until it has received no frame of the earlier host for
// a second. The emergency stop needs no turn, because all hosts send the same frame.
#pragma once

#include <chrono>
#include <cstdint>
#include <random>
#include <utility>

namespace r4 {

class CanTurn {
 public:
  using Time = std::chrono::steady_clock::time_point;
  using Duration = std::chrono::milliseconds;
  // Another host sends ten heartbeats a second, so it is heard within this time.
  static constexpr Duration listening{120};
  // Two hosts that begin within this time have not heard each other, and both fall silent.
  static constexpr Duration settling{50};
  // A board waits as long for its host. A random time is added, so that one of two hosts is first.
  static constexpr Duration silence{1000};
  static constexpr Duration most_chance{250};

  explicit CanTurn(std::uint32_t seed) : chance_(seed) {}

  void listen(Time now) {
    state_ = State::listening;
    until_ = now + listening;
  }
  bool ours(Time now) {
    if (state_ != State::ours && now >= until_) {
      state_ = State::ours;
      speaking_ = false;
    }
    return state_ == State::ours;
  }
  bool others() const { return state_ == State::others; }
  void on_own(Time now) {
    if (!speaking(now)) since_ = now;
    speaking_ = true;
    last_ = now;
  }
  // A frame of another host was heard. True if this host gives up its turn.
  bool on_other(Time now) {
    if (ours(now) && speaking(now) && now - since_ >= settling) return false;
    until_ = now + silence + Duration(chance_() % most_chance.count());
    return std::exchange(state_, State::others) == State::ours;
  }

 private:
  enum class State : std::uint8_t { listening, ours, others };

  // False after a long silence of this host, in which another host may have taken the turn.
  bool speaking(Time now) const { return speaking_ && now - last_ < silence; }

  std::minstd_rand chance_;
  State state_ = State::ours;
  Time until_;  // unless the state is `ours`: when the state becomes `ours`
  bool speaking_ = false;
  Time since_;  // when this host began to send
  Time last_;   // when this host last sent
};

}  // namespace r4
