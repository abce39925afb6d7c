// SPDX-License-Identifier: GPL-3.0-or-later
// The board's clock on the host's, without I/O. Two facts bound it, and neither supposes anything of
// the link:
//
//     a datagram with T came at r:                  the board's clock showed T before r
//     a question asked at a was answered with T:    it showed T + 1 ms after a
//
// Each is a limit of the offset, the host's time less the board's, at one T. An offset runs as the clocks
// drift apart: by a straight line, of at most 100 ppm. What lines the limits leave is what is known. The
// tightest of each second are kept, for the last minute: constant memory, and a clock whose drift
// follows the temperature is followed.
//
// The estimate is the middle of what is left, which is right where the fastest datagrams of both ways take
// as long. Where nothing has been answered (who only listens asks nothing) it is the upper limit, and
// the error is not known.
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
  // A datagram of the board with that T has come.
  void heard(std::uint32_t t_ms, Time now) { limit(upper_, t_ms, now, Time{0}); }
  // The answer to what was asked at that time has T = t_ms.
  void answered(std::uint32_t t_ms, Time asked) {
    limit(lower_, t_ms, asked, std::chrono::milliseconds{-1});
  }
  // The board has begun again, with another clock.
  void restart() { *this = BoardClock(); }

  struct Instant {
    Time at;
    std::optional<Time> error;  // the truth is no farther from it; none: not known
  };
  // When the board's clock began to show t_ms. Only once a datagram has come.
  Instant at(std::uint32_t t_ms) const;

  // How much slower than the host's the board's clock runs, and by how much that may be wrong; ppm.
  double drift_ppm() const { return (slowest_ + fastest_) / 2 * 1e6; }
  double drift_error_ppm() const { return (fastest_ - slowest_) / 2 * 1e6; }

  static constexpr double most_drift = 100e-6;

 private:
  // Microseconds, since the first datagram.
  struct Limit {
    std::int64_t second = none;  // of the board's clock; none: no limit
    double at = 0;
    double offset = 0;
  };
  static constexpr std::int64_t none = INT64_MIN;
  static constexpr int seconds = 64;
  using Limits = std::array<Limit, seconds>;

  // Of the lines that pass between the limits of a second and those of later ones, or of itself.
  struct Slopes {
    std::int64_t second = none;
    double slowest = -most_drift;
    double fastest = most_drift;

    void narrow(const Limit& upper, const Limit& lower);
  };

  // The tightest limit as it is now: at later times it is that much looser.
  struct Front {
    double at = 0;
    double offset = 0;
  };

  void limit(Limits& limits, std::uint32_t t_ms, Time host, Time margin);
  bool place(Limits& limits, std::uint32_t t_ms, Time host, Time margin);
  void next_second(std::int64_t second);
  void take_slopes(std::int64_t second);
  void narrow_drift(std::int64_t second);
  double since_first(std::uint32_t t_ms) const;
  static std::size_t slot_of(std::int64_t second) {
    return static_cast<std::size_t>((second % seconds + seconds) % seconds);
  }
  bool is_old(std::int64_t second) const { return second + seconds <= newest_second_; }
  // The limits of the offset at that time of the board.
  double highest(double at) const;
  double lowest(double at) const;
  double highest_of_all(double at) const;
  double lowest_of_all(double at) const;

  bool any_ = false;
  std::uint32_t newest_t_ms_ = 0;
  std::int64_t newest_board_ms_ = 0;  // the same since the first, which does not wrap
  std::int64_t newest_second_ = 0;
  Time first_{0};
  Limits upper_, lower_;
  std::array<Slopes, seconds> slopes_;
  Front high_{0, std::numeric_limits<double>::infinity()};
  Front low_{0, -std::numeric_limits<double>::infinity()};
  // What the offset may change by in one unit of time.
  double slowest_ = -most_drift;
  double fastest_ = most_drift;
};

}  // namespace r4
