// SPDX-License-Identifier: GPL-3.0-or-later
// Numbers lines from 1. A line ends with CR, LF or both. A UTF-8 byte order mark at the beginning
// is skipped. At most max_datagram characters are stored: a longer line is only measured.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "r4link/datagram.hpp"
#include "r4link/recordings/file_form.hpp"

namespace r4::tool {

class NumberedLines {
 public:
  // Calls line() for each complete line that is not empty, or too_long() above max_datagram.
  template <class Line, class TooLong>
  void push(std::string_view bytes, Line line, TooLong too_long) {
    while (!bytes.empty()) {
      const std::size_t end = std::min(bytes.find_first_of("\r\n"), bytes.size());
      const bool ends = end != bytes.size();
      size_ += end;
      if (size_ <= max_datagram) line_ += bytes.substr(0, end);
      if (!ends) {
        after_cr_ = false;
        return;
      }
      if (size_ > max_datagram) {
        too_long(number_, size_);
      } else {
        std::string_view text = line_;
        if (number_ == 1 && text.starts_with(utf8_mark)) text.remove_prefix(utf8_mark.size());
        if (!text.empty()) line(number_, text);
      }
      line_.clear();
      const bool second_half = bytes[end] == '\n' && end == 0 && after_cr_;
      if (!second_half) ++number_;
      begin_ += size_ + 1;
      size_ = 0;
      after_cr_ = bytes[end] == '\r';
      bytes.remove_prefix(end + 1);
    }
  }
  // Offset in bytes, from 0, of the line that is being reported.
  std::uint64_t begin() const { return begin_; }
  // Call at the end of the input, which may lie within a line.
  template <class Line, class TooLong>
  void finish(Line line, TooLong too_long) {
    if (size_ != 0) push("\n", line, too_long);
  }

 private:
  std::string line_;
  std::uint64_t number_ = 1;
  std::uint64_t begin_ = 0;
  std::uint64_t size_ = 0;
  bool after_cr_ = false;
};

}  // namespace r4::tool
