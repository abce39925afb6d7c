// SPDX-License-Identifier: GPL-3.0-or-later
// Which of several hosts sends on a board's one command id of a CAN bus (docs/can.md, "Several
// hosts"). Two that send on one id mix their frames, and on real wires drive each other bus-off; and
// as all answer a board's heartbeat at once, they would meet each time. So a host listens before it
// speaks, and of two, the one that came later is silent until it has heard nothing of the other for
// a second. The emergency stop is not concerned: all send the same frame.
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
  // A host that is there sends ten heartbeats a second: who listens so long has heard it.
  static constexpr Duration listening{120};
  // Two that begin within this time have not heard each other, and both fall silent.
  static constexpr Duration settling{50};
  // As long as a board waits for its host. And a little by chance: one of two is back first.
  static constexpr Duration silence{1000};
  static constexpr Duration most_chance{250};

  explicit CanTurn(std::uint32_t seed) : chance_(seed) {}

  // We have come to the bus.
  void listen(Time now) {
    state_ = State::listening;
    until_ = now + listening;
  }
  // May a datagram be begun?
  bool ours(Time now) {
    if (state_ != State::ours && now >= until_) {
      state_ = State::ours;
      speaking_ = false;
    }
    return state_ == State::ours;
  }
  // It may not, for another host is there.
  bool others() const { return state_ == State::others; }
  // A datagram of ours has begun.
  void on_own(Time now) {
    if (!speaking(now)) since_ = now;
    speaking_ = true;
    last_ = now;
  }
  // A frame of another host's was heard. True: ours fell silent for it.
  bool on_other(Time now) {
    if (ours(now) && speaking(now) && now - since_ >= settling) return false;
    until_ = now + silence + Duration(chance_() % most_chance.count());
    return std::exchange(state_, State::others) == State::ours;
  }

 private:
  enum class State : std::uint8_t { listening, ours, others };

  // Do we still speak? A host that was silent for long, because it was held up, may have lost its place.
  bool speaking(Time now) const { return speaking_ && now - last_ < silence; }

  std::minstd_rand chance_;
  State state_ = State::ours;
  Time until_;  // while others have the turn: it cannot be ours before
  bool speaking_ = false;
  Time since_;  // when our speaking began
  Time last_;   // when we spoke last
};

}  // namespace r4
