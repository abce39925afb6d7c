// SPDX-License-Identifier: GPL-3.0-or-later
#include "stop_detector.hpp"

#include "../protocol/messages/command_field.hpp"
#include "r4link/command.hpp"
#include "r4link/datagram.hpp"

namespace r4 {
namespace firmware {

namespace {

// True if a field begins like a stop. Commands come first, so usually the first byte decides.
bool may_be_stop(Text datagram) {
  constexpr Text stop("E:S");
  for (std::size_t i = 0; i + stop.size() <= datagram.size(); ++i) {
    const bool begins = i == 0 || datagram[i - 1] == ';';
    if (begins && datagram.substr(i, stop.size()) == stop) return true;
  }
  return false;
}

}  // namespace

bool is_stop(Text datagram) {
  Datagram fields;
  return may_be_stop(datagram) && read_datagram(datagram, fields) && asks_to_stop(fields);
}

bool StopDetector::push(char byte) {
  if (byte == '\r' || byte == '\n') {
    const bool stop = size_ <= max_line && is_stop(Text(line_, size_));
    size_ = 0;
    return stop;
  }
  if (size_ < max_line) line_[size_] = byte;
  if (size_ <= max_line) ++size_;
  return false;
}

}  // namespace firmware
}  // namespace r4
