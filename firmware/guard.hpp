// SPDX-License-Identifier: GPL-3.0-or-later
// What watches over the application from outside its loop: a timer interrupt calls tick() every
// millisecond, and so the outputs become safe in time whatever the loop is waiting for.
//
//     what                      seen when                          then
//     the host falls silent     the link's deadline has passed     outputs safe, cause link
//     E:STOP has come in        stop() was called                   outputs safe, cause stop
//     a duty hangs              5 deadlines missed in a row        outputs safe, cause watchdog
//     a duty is often late      2 missed a second for long         outputs safe, cause watchdog
//     a duty stays away         tick() does not return true        the port starves the hardware
//                                                                  watchdog, which resets the board
//     a duty too many           add_duty()                         both, and again, whatever clears
//                                                                  it: nobody would watch that duty
//
// A duty is what must happen again and again: a turn of the loop, of a thread, of another interrupt.
// It checks in each time. The application learns what the guard did at its next turn (take()).
//
// tick() runs in an interrupt, on the core that it interrupts; check_in() may be called anywhere,
// also in another thread.
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

  // A duty that checks in at least every `limit_ms` (1 …). Before the first tick(). no_duty, and the
  // outputs stay safe for good: there are max_duties already.
  Duty add_duty(std::uint32_t limit_ms);
  // For no_duty nothing happens.
  void check_in(Duty duty) {
    if (duty < max_duties) duties_[duty].seen.store(true, std::memory_order_relaxed);
  }

  // Outputs are live until `deadline_ms` unless it is put off, or until disarm().
  void arm(std::uint32_t deadline_ms);
  void disarm() { armed_.store(false, std::memory_order_relaxed); }

  // E:STOP has come in, in an interrupt or a thread that need not wait for the loop
  // (stop_detector.hpp): outputs safe at the next tick(), which may be called for it at once.
  void stop() { stops_heard_.fetch_add(1, std::memory_order_release); }
  // How often that was since boot; it wraps. The application has to find as many datagrams.
  std::uint32_t stops_heard() const { return stops_heard_.load(std::memory_order_acquire); }

  // A millisecond has passed. True: every duty has checked in since it was last true, so the
  // hardware watchdog may be fed.
  bool tick(std::uint32_t now_ms);

  // Has the guard made the outputs safe since the last take()?
  bool tripped() const { return tripped_.load(std::memory_order_relaxed) != SafeReason::none; }
  // Why: none, link, watchdog or stop. From now on it may trip again.
  SafeReason take() { return tripped_.exchange(SafeReason::none, std::memory_order_relaxed); }

  // Deadlines that duties missed since boot.
  std::uint32_t missed() const { return missed_.load(std::memory_order_relaxed); }

  // A miss costs so much, a millisecond pays 1 back, and more than the credit is a trip: 5 misses at
  // once, or more than 2 a second.
  static constexpr std::uint32_t miss_cost = 500;
  static constexpr std::uint32_t credit = 4 * miss_cost;

 private:
  struct Watched {
    std::atomic<bool> seen{false};
    // Of tick() alone.
    std::uint32_t limit_ms = 0;
    std::uint32_t seen_ms = 0;  // or missed
    bool due = true;            // has not checked in since tick() was last true
  };

  void trip(SafeReason cause);

  Hal& hal_;
  Watched duties_[max_duties];
  std::uint8_t duty_count_ = 0;
  bool unwatched_ = false;  // a duty was refused
  std::atomic<bool> armed_{false};
  std::atomic<std::uint32_t> stops_heard_{0};
  std::atomic<std::uint32_t> deadline_ms_{0};
  std::atomic<SafeReason> tripped_{SafeReason::none};
  std::atomic<std::uint32_t> missed_{0};
  // Of tick() alone.
  bool started_ = false;
  std::uint32_t stops_obeyed_ = 0;
  std::uint32_t debt_ = 0;
};

}  // namespace firmware
}  // namespace r4
