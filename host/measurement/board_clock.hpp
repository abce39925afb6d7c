// SPDX-License-Identifier: GPL-3.0-or-later
// Estimates the board's clock in the host's time, without I/O. Two facts limit the estimate:
//     a datagram with T came at r:                  the board's clock showed T before r
//     a question asked at a was answered with T:    the board's clock showed T + 1 ms after a
//
// Each fact limits the offset (the host's time less the board's) at one T, from above or from
// below. The offset drifts along a straight line, by at most 100 ppm. Every line between the limits
// is possible. The tightest limits of each second are kept for the last minute. So the memory is
// constant, and the estimate follows a drift that changes with the temperature.
//
// The estimate is the middle of the remaining range. If the fastest datagrams take equally long in
// both directions, the estimate is exact. Without answers (a watcher may not be able to ask) the
// estimate is the upper limit, and its error is unknown.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <limits>
#include <optional>

#include "r4link/link.hpp"

namespace r4 {

class BoardClock {
 public:
  void heard(std::uint32_t t_ms, Time now) { limit(upper_, t_ms, now, Time{0}); }
  // `asked`: when the question was first sent.
  void answered(std::uint32_t t_ms, Time asked) {
    limit(lower_, t_ms, asked, std::chrono::milliseconds{-1});
  }
  void restart() { *this = BoardClock(); }

  struct Instant {
    Time at;
    std::optional<Time> error;  // largest error of `at`; no value: unknown
  };
  // When the board's clock began to show t_ms. Call at() only after heard() or answered().
  Instant at(std::uint32_t t_ms) const;

  // How much slower the board's clock runs than the host's clock, and the error of this drift; ppm.
  double drift_ppm() const { return (slowest_ + fastest_) / 2 * 1e6; }
  double drift_error_ppm() const { return (fastest_ - slowest_) / 2 * 1e6; }

  static constexpr double most_drift = 100e-6;

 private:
  // `at`: microseconds of the board's clock since the first datagram. `offset`: microseconds.
  struct Limit {
    std::int64_t second = none;  // of the board's clock; none: no limit
    double at = 0;
    double offset = 0;
  };
  static constexpr std::int64_t none = INT64_MIN;
  static constexpr int seconds = 64;

  // The lower side negates each offset, so one algorithm serves both sides.
  struct Side {
    std::array<Limit, seconds> limits;
    // The tightest limit at present. The drift loosens the limit with time.
    Limit front{none, 0, std::numeric_limits<double>::infinity()};
  };

  // The slopes of lines from the limits of one second to limits of the same or a later second.
  struct Slopes {
    std::int64_t second = none;
    double slowest = -most_drift;
    double fastest = most_drift;

    void narrow(const Limit& upper, const Limit& lower);
  };

  void limit(Side& side, std::uint32_t t_ms, Time host, Time margin);
  bool place(Side& side, std::uint32_t t_ms, Time host, Time margin);
  void next_second(std::int64_t second);
  void take_slopes(std::int64_t second);
  void narrow_drift(std::int64_t second);
  double since_first(std::uint32_t t_ms) const;
  static std::size_t slot_of(std::int64_t second) {
    return static_cast<std::size_t>((second % seconds + seconds) % seconds);
  }
  bool is_old(std::int64_t second) const { return second + seconds <= newest_second_; }
  bool is_upper(const Side& side) const { return &side == &upper_; }
  // A side's limit at the board's time `at`: from its front, and from all its limits.
  double highest(const Side& side, double at) const;
  double highest_of_all(const Side& side, double at) const;
  double moved(const Side& side, const Limit& limit, double later) const;

  bool any_ = false;
  std::uint32_t newest_t_ms_ = 0;
  std::int64_t newest_board_ms_ = 0;  // since the first datagram, without the wrap
  std::int64_t newest_second_ = 0;
  Time first_{0};
  Side upper_, lower_;
  std::array<Slopes, seconds> slopes_;
  double slowest_ = -most_drift;
  double fastest_ = most_drift;
};

}  // namespace r4
