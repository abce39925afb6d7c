// SPDX-License-Identifier: GPL-3.0-or-later
// Decides whether to poll for the next arrival, or to sleep until the system wakes the process.
//
// Between programs of one computer the next frame often comes sooner than a process goes to sleep
// and wakes up. So the program polls while the last silence of the same kind was short, as Linux's
// haltpoll governor does: a program that is answered at once stays awake, a program that waits for
// the next period sleeps. The caller must yield the processor between two polls. Without I/O.
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
  // Silences in the middle of a transfer are short, however long those between transfers are.
  enum class Silence : std::uint8_t { within, between };

  // A silence is polled through for `most` at most.
  explicit AdaptivePolling(Duration most) : most_(most), last_{forever, forever} {}

  void on_arrival(Time now) {
    if (silent_) last_[index()] = now - since_;
    silent_ = false;
  }
  // Everything that had arrived has been taken.
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
