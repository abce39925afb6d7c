// SPDX-License-Identifier: GPL-3.0-or-later
// How long a sample was under way, as far as that can be known. In a graph of one computer the clock tells: there is
// one. The clocks of two computers differ, so what counts is by how much it was slower than the fastest of its
// publisher. They may drift apart by 0.02 %, but never by more than half a second between two samples: of who is silent
// for long, one that a network held back would pass for fresh. A clock that was set makes all samples look slow: where
// none is fast of those that come in ten seconds or more, and ten of them are a second apart, that is believed. The
// first sample of a publisher has nothing to be compared with.
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
    const Duration drifted = std::min<Duration>(elapsed / drift, most_drifted);
    least_ = std::min(*least_ + drifted, difference);
    const Duration delay = difference - *least_;
    if (delay <= slow) {
      slow_.reset();
      return delay;
    }
    if (!slow_) slow_ = Slow{received, received - apart, difference, 0};
    slow_->least = std::min(slow_->least, difference);
    if (received - slow_->counted >= apart) {
      slow_->counted = received;
      ++slow_->samples;
    }
    if (slow_->samples < enough || received - slow_->since < patience) return delay;
    least_ = slow_->least;
    slow_.reset();
    return difference - *least_;
  }

 private:
  struct Slow {
    Duration since;
    Duration counted;  // the newest of them that was
    Duration least;
    int samples;  // a second apart: what a network held back comes at once
  };
  static constexpr int drift = 5000;
  static constexpr std::chrono::milliseconds most_drifted{500};
  static constexpr std::chrono::milliseconds slow{200};
  static constexpr std::chrono::seconds patience{10};
  static constexpr std::chrono::seconds apart{1};
  static constexpr int enough = 10;
  const Clocks clocks_;
  Duration last_{0};
  std::optional<Duration> least_;
  std::optional<Slow> slow_;  // samples of which none was fast
};

}  // namespace r4::tool::ros2
