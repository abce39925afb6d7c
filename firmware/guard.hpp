// SPDX-License-Identifier: GPL-3.0-or-later
// Makes the outputs safe even if the loop hangs. A timer interrupt calls tick() each millisecond.
//     event                     detected by                        reaction
//     the host falls silent     the link's deadline has passed     outputs safe, cause link
//     E:STOP has arrived        stop() was called                  outputs safe, cause stop
//     a duty hangs              5 deadlines missed in a row        outputs safe, cause watchdog
//     a duty is often late      2 missed a second for long         outputs safe, cause watchdog
//     a duty stays away         tick() does not return true        the watchdog resets the board
//     too many duties           add_duty()                         outputs safe (watchdog), reset;
//                                                                  again after each clear, because
//                                                                  that duty would be unwatched
//
// A duty is work that must repeat: a turn of the loop, of a thread, of another interrupt. A duty
// checks in each time, in any thread. tick() runs in an interrupt, on the core that it interrupts.
#pragma once

#include <atomic>
#include <cstdint>

#include "hal.hpp"

namespace r4 {
namespace firmware {

class Guard {
 public:
  using Duty = std::uint8_t;
  static constexpr int max_duties = 8;
  static constexpr Duty no_duty = max_duties;

  explicit Guard(Hal& hal) : hal_(hal) {}

  // Adds a duty that checks in at least every `limit_ms` (1 …). Call before the first tick(). If
  // there are max_duties already, returns no_duty, and the outputs stay safe.
  Duty add_duty(std::uint32_t limit_ms);
  void check_in(Duty duty) {
    if (duty < max_duties) duties_[duty].seen.store(true, std::memory_order_relaxed);
  }

  // If neither arm() moves the deadline nor disarm() ends it, outputs become safe at `deadline_ms`.
  void arm(std::uint32_t deadline_ms);
  void disarm() { armed_.store(false, std::memory_order_relaxed); }

  // E:STOP has arrived in an interrupt or a thread that does not wait for the loop
  // (stop_detector.hpp). The next tick(), which may follow at once, makes the outputs safe.
  void stop() { stops_heard_.fetch_add(1, std::memory_order_release); }
  // Calls of stop() since boot; wraps. For each call, the application must read a stop datagram.
  std::uint32_t stops_heard() const { return stops_heard_.load(std::memory_order_acquire); }

  // True if every duty has checked in since tick() last returned true: the watchdog may be fed.
  bool tick(std::uint32_t now_ms);

  // True if the guard has made the outputs safe since the last take().
  bool tripped() const { return tripped_.load(std::memory_order_relaxed) != SafeReason::none; }
  // Returns none, link, watchdog or stop. Afterwards the guard may trip again.
  SafeReason take() { return tripped_.exchange(SafeReason::none, std::memory_order_relaxed); }

  std::uint32_t missed() const { return missed_.load(std::memory_order_relaxed); }

  // Each miss adds miss_cost to a debt, and each millisecond subtracts 1. A debt above the credit
  // trips the guard: 5 misses at once, or more than 2 a second.
  static constexpr std::uint32_t miss_cost = 500;
  static constexpr std::uint32_t credit = 4 * miss_cost;

 private:
  struct Watched {
    std::atomic<bool> seen{false};
    // Used by tick() only.
    std::uint32_t limit_ms = 0;
    std::uint32_t seen_ms = 0;
    bool due = true;  // has not checked in since tick() last returned true
  };

  void trip(SafeReason cause);

  Hal& hal_;
  Watched duties_[max_duties];
  std::uint8_t duty_count_ = 0;
  bool unwatched_ = false;  // add_duty() failed
  std::atomic<bool> armed_{false};
  std::atomic<std::uint32_t> stops_heard_{0};
  std::atomic<std::uint32_t> deadline_ms_{0};
  std::atomic<SafeReason> tripped_{SafeReason::none};
  std::atomic<std::uint32_t> missed_{0};
  // Used by tick() only.
  bool started_ = false;
  std::uint32_t stops_obeyed_ = 0;
  std::uint32_t debt_ = 0;
};

}  // namespace firmware
}  // namespace r4
