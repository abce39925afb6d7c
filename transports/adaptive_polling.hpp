// SPDX-License-Identifier: GPL-3.0-or-later
// Whether to ask again and again for what comes next, or to sleep until it wakes us.
//
// Between programs of one machine the next thing often comes sooner than a process goes to sleep and
// is woken up. It is asked for while the last silence of its kind was short, as Linux's haltpoll
// governor does: who is answered at once stays awake, who waits for the next period sleeps. For a
// processor of one's own or one whose other users get it in between. Sans-I/O.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>

namespace r4 {

class AdaptivePolling {
 public:
  using Time = std::chrono::steady_clock::time_point;
  using Duration = std::chrono::steady_clock::duration;
  // A silence is over soon in the middle of a transfer, whatever it is between transfers.
  enum class Silence : std::uint8_t { within, between };

  // Nothing is asked for longer than `most`.
  explicit AdaptivePolling(Duration most) : most_(most), last_{forever, forever} {}

  void on_arrival(Time now) {
    if (silent_) last_[index()] = now - since_;
    silent_ = false;
  }
  // All that had arrived has been taken.
  void on_silence(Silence kind, Time now) {
    if (silent_ && kind == kind_) return;
    silent_ = true;
    kind_ = kind;
    since_ = now;
  }
  bool worthwhile(Time now) const {
    return silent_ && last_[index()] <= most_ && now - since_ < most_;
  }

 private:
  static constexpr Duration forever = Duration::max();
  std::size_t index() const { return static_cast<std::size_t>(kind_); }

  Duration most_;
  std::array<Duration, 2> last_;
  Silence kind_ = Silence::between;
  bool silent_ = false;
  Time since_;
};

}  // namespace r4
