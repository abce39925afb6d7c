// SPDX-License-Identifier: GPL-3.0-or-later
// A view of characters: a string_view for the portable core, which is C++14. A Text owns nothing,
// has no NUL at its end and may hold any byte. Valid as long as the buffer.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

namespace r4 {

class Text {
 public:
  constexpr Text() = default;
  constexpr Text(const char* data, std::size_t size) : data_(data), size_(size) {}
  // A string literal, without its NUL. Implicit, as for a string_view.
  // NOLINTBEGIN(google-explicit-constructor)
  template <std::size_t N>
  constexpr Text(const char (&literal)[N]) : data_(literal), size_(N - 1) {}
  // Any contiguous container with data() and size(), such as std::string and std::string_view.
  template <class Container, class = decltype(static_cast<const char*>(
                                 static_cast<const Container*>(nullptr)->data()))>
  constexpr Text(const Container& c) : data_(c.data()), size_(c.size()) {}
  // NOLINTEND(google-explicit-constructor)

  constexpr const char* data() const { return data_; }
  constexpr std::size_t size() const { return size_; }
  constexpr bool empty() const { return size_ == 0; }
  constexpr const char* begin() const { return data_; }
  constexpr const char* end() const { return data_ + size_; }
  constexpr char operator[](std::size_t i) const { return data_[i]; }
  // `count` characters from `from`, or all to the end; `from` is at most size().
  constexpr Text substr(std::size_t from, std::size_t count = ~std::size_t{0}) const {
    return Text(data_ + from, count < size_ - from ? count : size_ - from);
  }

  friend bool operator==(Text a, Text b) {
    return a.size_ == b.size_ && same(a.data_, b.data_, a.size_);
  }
  friend bool operator!=(Text a, Text b) { return !(a == b); }

 private:
  // Compares short texts without a call of memcmp(): compares both ends, which may overlap.
  template <class Word>
  static bool same_ends(const char* a, const char* b, std::size_t size) {
    Word words[4];
    std::memcpy(&words[0], a, sizeof(Word));
    std::memcpy(&words[1], b, sizeof(Word));
    std::memcpy(&words[2], a + size - sizeof(Word), sizeof(Word));
    std::memcpy(&words[3], b + size - sizeof(Word), sizeof(Word));
    return words[0] == words[1] && words[2] == words[3];
  }
  static bool same(const char* a, const char* b, std::size_t size) {
    if (size > 16) return std::memcmp(a, b, size) == 0;
    if (size >= 8) return same_ends<std::uint64_t>(a, b, size);
    if (size >= 4) return same_ends<std::uint32_t>(a, b, size);
    if (size >= 2) return same_ends<std::uint16_t>(a, b, size);
    return size == 0 || *a == *b;
  }

  const char* data_ = nullptr;
  std::size_t size_ = 0;
};

}  // namespace r4
