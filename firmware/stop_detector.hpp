// SPDX-License-Identifier: GPL-3.0-or-later
// Detects E:STOP in an interrupt where datagrams arrive, so that Guard::stop() makes the outputs
// safe without waiting for the loop. The loop also gets the datagram.
#pragma once

#include <cstddef>

#include "r4link/text.hpp"

namespace r4 {
namespace firmware {

// True for a valid datagram with E:STOP among its fields. Quick for any other datagram.
bool is_stop(Text datagram);

// Takes bytes of lines. A stop in a line longer than max_line is left to the loop.
class StopDetector {
 public:
  static constexpr std::size_t max_line = 128;

  // True at the end of a line that is a stop.
  bool push(char byte);
  void reset() { size_ = 0; }

 private:
  char line_[max_line];
  std::size_t size_ = 0;  // above max_line: too long
};

}  // namespace firmware
}  // namespace r4
