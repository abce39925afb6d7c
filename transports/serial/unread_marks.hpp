// SPDX-License-Identifier: GPL-3.0-or-later
// Computes when the oldest unread byte was written: exact to `grain`, never too late. No heap.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>

namespace r4 {

class UnreadMarks {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr std::chrono::milliseconds grain{2};

  void wrote(std::size_t bytes, Time now);
  void unread_at_most(std::size_t bytes);
  void clear() { count_ = 0; }

  bool any() const { return count_ != 0; }
  Time oldest() const { return marks_[first_].time; }

 private:
  // Bytes up to the number `end`, written at `time` or up to a grain later.
  struct Mark {
    std::uint64_t end = 0;
    Time time{};
  };

  std::array<Mark, 64> marks_;
  std::size_t first_ = 0;
  std::size_t count_ = 0;
  std::uint64_t written_ = 0;
};

inline void UnreadMarks::wrote(std::size_t bytes, Time now) {
  written_ += bytes;
  if (count_ != 0) {
    Mark& last = marks_[(first_ + count_ - 1) % marks_.size()];
    if (now - last.time < grain || count_ == marks_.size()) {
      last.end = written_;
      return;
    }
  }
  marks_[(first_ + count_) % marks_.size()] = {written_, now};
  ++count_;
}

inline void UnreadMarks::unread_at_most(std::size_t bytes) {
  while (count_ != 0 && marks_[first_].end + bytes <= written_) {
    first_ = (first_ + 1) % marks_.size();
    --count_;
  }
}

}  // namespace r4
