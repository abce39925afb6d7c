// SPDX-License-Identifier: GPL-3.0-or-later
// The stop that was confirmed last, repeated for a while longer: somebody's E:CLEAR may have been on its
// way. Without I/O.
//
//     idle --a stop is confirmed--> repeating --the time is over, another stop, or an E:CLEAR of ours--> idle
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <string_view>

#include "../measurement/time.hpp"
#include "r4link/datagram.hpp"

namespace r4 {

class StopRepetition {
 public:
  // `stop`: its datagram, unsigned. It goes out again at `next`, then every `interval` until `end`.
  void begin(std::string_view stop, Time next, Time end) {
    std::copy(stop.begin(), stop.end(), bytes_.begin());
    size_ = stop.size();
    next_ = next;
    end_ = end;
  }
  void cancel() { size_ = 0; }

  // The datagram that is to be sent now; empty: none.
  std::string_view due(Time interval, Time now) {
    if (size_ == 0 || now < next_) return {};
    if (now >= end_) {
      cancel();
      return {};
    }
    next_ = now + interval;
    return {bytes_.data(), size_};
  }
  // When due() has something to say next; Time::max() for never.
  Time next() const { return size_ != 0 ? next_ : Time::max(); }

 private:
  std::array<char, max_datagram> bytes_;
  std::size_t size_ = 0;  // 0: idle
  Time next_{0};
  Time end_{0};
};

}  // namespace r4
