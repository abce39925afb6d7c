// SPDX-License-Identifier: GPL-3.0-or-later
// Datagrams on a byte stream, one per line (docs/reference/protocol.md "On a byte stream").
// A line ends with CR, LF or both; sent lines end with CR LF. Empty lines are ignored. A line
// longer than max_datagram is counted and discarded up to its terminator. So noise, a cut or a
// wrong baud rate affects only the lines in which it occurs. No heap; memory is one line.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "r4link/datagram.hpp"

namespace r4 {

class LineFraming {
 public:
  // Calls `on_line(Text)` for each line without its end, and `on_oversize(Text)` as soon as a line
  // is too long, with its first max_datagram bytes. The Text is valid during the call.
  template <class OnLine, class OnOversize>
  void push(const char* data, std::size_t size, OnLine&& on_line, OnOversize&& on_oversize);
  template <class OnLine>
  void push(const char* data, std::size_t size, OnLine&& on_line) {
    push(data, size, on_line, [](Text) {});
  }

  // Discards an unfinished line, because the stream was reopened.
  void reset();

  std::uint32_t oversize() const { return oversize_; }  // discarded lines
  std::size_t pending() const { return used_; }         // bytes of the unfinished line

 private:
  static const char* find(char wanted, const char* begin, const char* end) {
    const void* const at = std::memchr(begin, wanted, static_cast<std::size_t>(end - begin));
    return at == nullptr ? end : static_cast<const char*>(at);
  }

  char line_[max_datagram];
  std::size_t used_ = 0;
  std::uint32_t oversize_ = 0;
  bool skipping_ = false;  // inside a line that is too long
};

constexpr Text line_end("\r\n");

template <class OnLine, class OnOversize>
void LineFraming::push(const char* data, std::size_t size, OnLine&& on_line,
                       OnOversize&& on_oversize) {
  const char* const end = data + size;
  const char* feed = nullptr;  // the next line feed, or the end
  while (data != end) {
    if (feed == nullptr || feed < data) feed = find('\n', data, end);
    const char* const stop = find('\r', data, feed);
    const std::size_t length = static_cast<std::size_t>(stop - data);
    if (!skipping_ && used_ + length > max_datagram) {
      skipping_ = true;
      std::memcpy(line_ + used_, data, max_datagram - used_);
      used_ = 0;
      ++oversize_;
      on_oversize(Text(line_, max_datagram));
    }
    if (stop == end) {
      if (!skipping_ && length != 0) {
        std::memcpy(line_ + used_, data, length);
        used_ += length;
      }
      return;
    }
    if (!skipping_) {
      if (used_ == 0) {
        if (length != 0) on_line(Text(data, length));
      } else {
        std::memcpy(line_ + used_, data, length);
        const Text line(line_, used_ + length);
        used_ = 0;
        on_line(line);
      }
    }
    skipping_ = false;
    data = stop + 1;
  }
}

inline void LineFraming::reset() {
  used_ = 0;
  skipping_ = false;
}

}  // namespace r4
