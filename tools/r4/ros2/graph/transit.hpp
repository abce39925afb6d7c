// SPDX-License-Identifier: GPL-3.0-or-later
// Estimates the transit time of samples. On one computer the common clock measures this time. The
// clocks of two computers differ, so the delay is relative to the publisher's fastest sample. The
// first sample has no reference. Clocks may drift by 0.02 %, but by at most 0.5 s between two
// samples, because a delayed sample after a long silence must not seem fresh. After a clock was
// set, all samples seem slow. The new offset is accepted after ten slow samples a second apart.
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

  // `written`, `received`: wall clocks. With two clocks, the delay of the fastest sample is 0.
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
    Duration counted;  // newest counted sample
    Duration least;
    int samples;  // slow samples a second apart, because delayed samples arrive together
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
  std::optional<Slow> slow_;  // samples since the last fast sample
};

}  // namespace r4::tool::ros2
