// SPDX-License-Identifier: GPL-3.0-or-later
// Decides whether to poll for the next arrival or to sleep. Polls if the last silence of the same
// kind was short, as Linux's haltpoll governor does. A frame often arrives sooner than a process
// sleeps and wakes. The caller must yield the processor between two polls. No I/O.
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
  // Silences within a transfer are short, even if silences between transfers are long.
  enum class Silence : std::uint8_t { within, between };

  // `most`: the longest time to poll through a silence.
  explicit AdaptivePolling(Duration most) : most_(most), last_{forever, forever} {}

  void on_arrival(Time now) {
    if (silent_) last_[index()] = now - since_;
    silent_ = false;
  }
  // Call when all arrived frames are taken.
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
