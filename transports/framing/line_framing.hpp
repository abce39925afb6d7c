// SPDX-License-Identifier: GPL-3.0-or-later
// Datagrams on a byte stream: one a line (docs/protocol.md "On a byte stream").
//
// A line ends with CR, LF or both; empty lines are passed over. We send CR LF. A line longer than
// max_datagram is counted and thrown away up to its terminator, so that noise, a cut or a foreign
// speed costs the datagrams it hit and no more. No heap; memory is one line.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "r4link/datagram.hpp"

namespace r4 {

class LineFraming {
 public:
  // Feeds `size` bytes; calls `on_line(Text)` for each line that they complete, without terminator.
  // A line that lies whole in `data` is passed in place, without a copy. The Text is valid in the
  // call. `on_oversize(Text)` is called for each line that is too long, once it is, with its first max_datagram bytes.
  template <class OnLine, class OnOversize>
  void push(const char* data, std::size_t size, OnLine&& on_line, OnOversize&& on_oversize);
  template <class OnLine>
  void push(const char* data, std::size_t size, OnLine&& on_line) {
    push(data, size, on_line, [](Text) {});
  }

  // Forgets an unfinished line (the stream was closed and opened again).
  void reset();

  std::uint32_t oversize() const { return oversize_; }  // lines thrown away
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

// What ends a line that we send.
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
