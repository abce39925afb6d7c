// SPDX-License-Identifier: GPL-3.0-or-later
// Hears E:STOP where datagrams come in, in an interrupt: Guard::stop() then makes the outputs safe,
// and what the loop is busy with does not delay it. The datagram itself goes its usual way.
#pragma once

#include <cstddef>

#include "r4link/text.hpp"

namespace r4 {
namespace firmware {

// Is it a valid datagram with E:STOP among its fields? Little is done for any other.
bool is_stop(Text datagram);

// Bytes of lines, as they come. A stop in a line longer than max_line is left to the loop.
class StopDetector {
 public:
  static constexpr std::size_t max_line = 128;

  // True at the end of a line that is a stop.
  bool push(char byte);
  // Forgets an unfinished line.
  void reset() { size_ = 0; }

 private:
  char line_[max_line];
  std::size_t size_ = 0;  // above max_line: too long
};

}  // namespace firmware
}  // namespace r4
