// SPDX-License-Identifier: GPL-3.0-or-later
// How long a sample was under way, as far as that can be known. In a graph of one computer the clock tells: there is
// one. The clocks of two computers differ, so what counts is by how much it was slower than the fastest of its
// publisher. They may drift apart by 0.1 %. One that was set makes all samples look slow: where they come for ten
// seconds without a break and none is fast, that is believed. The first sample of a publisher has nothing to be
// compared with.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <optional>

namespace r4::tool::ros2 {

class Transit {
 public:
  using Duration = std::chrono::nanoseconds;
  enum class Clocks : std::uint8_t { one, two };

  explicit Transit(Clocks clocks) : clocks_(clocks) {}

  // `written` and `received`: by the wall clocks of the two. Returns the delay; of two clocks 0 for the fastest.
  Duration delay(Duration written, Duration received) {
    const Duration difference = received - written;
    if (clocks_ == Clocks::one) return std::max(difference, Duration(0));
    const Duration elapsed = std::max(received - last_, Duration(0));
    last_ = received;
    if (!least_) least_ = difference;
    least_ = std::min(*least_ + elapsed / drift, difference);
    const Duration delay = difference - *least_;
    if (delay <= slow) {
      slow_.reset();
      return delay;
    }
    if (!slow_ || elapsed > longest_break) slow_ = Slow{received, difference};
    slow_->least = std::min(slow_->least, difference);
    if (received - slow_->since < patience) return delay;
    least_ = slow_->least;
    slow_.reset();
    return difference - *least_;
  }

 private:
  struct Slow {
    Duration since;
    Duration least;
  };
  static constexpr int drift = 1000;
  static constexpr std::chrono::milliseconds slow{200};
  static constexpr std::chrono::seconds longest_break{1};
  static constexpr std::chrono::seconds patience{10};
  const Clocks clocks_;
  Duration last_{0};
  std::optional<Duration> least_;
  std::optional<Slow> slow_;  // samples that come without a break, all of them slow
};

}  // namespace r4::tool::ros2
