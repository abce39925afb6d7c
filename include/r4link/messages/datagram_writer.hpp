// SPDX-License-Identifier: GPL-3.0-or-later
// Writes one datagram into a buffer that the caller owns.
//
//     char buffer[max_datagram];
//     DatagramWriter w(buffer, sizeof buffer);
//     w.field("O").value(358).value(1).value(1);
//     Text datagram = w.finish(pnum, t_ms);   // "O:358,1,1;PNum:66;T:79146;^0x…^"
//
// What does not fit is refused as a whole: finish() returns an empty Text. Names and texts with
// bytes that the grammar does not allow (datagram.hpp) refuse it too, so no writer can forge a
// field.
#pragma once

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../text.hpp"
#include "../vocabulary.hpp"

namespace r4 {

// A name that is known when the program is compiled, as the wire has it in front of a value:
// ";OSMC1:". Made at compile time, so that writing it takes no check and no loop. At most 12
// characters: the compiler refuses a longer one.
class FieldName {
 public:
  constexpr FieldName() = default;
  explicit constexpr FieldName(Text name) : size_(static_cast<std::uint8_t>(name.size())) {
    text_[0] = ';';
    for (std::size_t i = 0; i < name.size(); ++i) text_[i + 1] = name[i];
    text_[name.size() + 1] = ':';
    text_[name.size() + 2] = '\0';  // outside of text_ for a longer one
  }
  constexpr Text name() const { return Text(text_ + 1, size_); }
  // True if it is of the grammar. For a static_assert beside the names.
  constexpr bool allowed() const {
    if (size_ == 0 || size_ > 12) return false;
    for (int i = 1; i <= size_; ++i) {
      const char c = text_[i];
      if (c <= ' ' || c > '~' || c == ':' || c == ';' || c == ',' || c == '^') return false;
    }
    return true;
  }

 private:
  friend class DatagramWriter;
  char text_[15] = {};
  std::uint8_t size_ = 0;  // of the name alone
};

class R4LINK_API DatagramWriter {
 public:
  // Goes on behind the first `used` bytes of the buffer: size() of a writer that wrote them there.
  DatagramWriter(char* buffer, std::size_t capacity, std::size_t used = 0)
      : begin_(buffer),
        at_(buffer + used),
        end_(buffer + capacity),
        open_(used != 0),
        has_value_(used != 0) {}

  DatagramWriter& field(Text name);
  DatagramWriter& field(const FieldName& name);
  DatagramWriter& value(Text text);
  DatagramWriter& value(std::uint32_t value);
  DatagramWriter& value(std::int32_t value);
  DatagramWriter& value(std::uint64_t value);
  DatagramWriter& hundredths(std::int32_t value);  // 2428 is written 24.28
  // A text that may hold commas: "ROS2-R4", "a,b". Copied as it is.
  DatagramWriter& values(Text text);

  // Goes on in the value that was written last.
  DatagramWriter& more(Text text);

  // Bytes written so far, and whether all of them did fit and were allowed.
  std::size_t size() const { return static_cast<std::size_t>(at_ - begin_); }
  Text written() const { return Text(begin_, size()); }
  bool ok() const { return ok_; }

  // Takes everything after `size` back (a field that turned out too long for a split datagram).
  // `size` is what size() was before a field(), while ok() was true; it is true again.
  void truncate(std::size_t size);

  // Writes SID, in front of PNum; nothing if it is no_session.
  DatagramWriter& session(SessionId sid);
  // Writes PNum: the last field of a session's command, but for a signature (authentication.hpp).
  DatagramWriter& packet(std::uint32_t pnum);
  // Writes PNum and T: the last fields of any other datagram, likewise.
  DatagramWriter& stamp(std::uint32_t pnum, std::uint64_t t_ms);
  // Closes with PNum, T and the CRC. An empty Text if anything did not fit or was not allowed, or
  // if the datagram is longer than max_datagram.
  Text finish(std::uint32_t pnum, std::uint64_t t_ms);
  // Closes with the CRC alone: the fields, PNum and T among them, are as the caller wrote them.
  Text finish();

  // Room that finish(pnum, t) needs at most:
  // ";PNum:4294967295;T:18446744073709551615;^0xffffffff^".
  static constexpr std::size_t trailer_max = 52;

 private:
  R4LINK_PRIVATE bool reserve(std::size_t bytes);
  R4LINK_PRIVATE DatagramWriter& append(Text text, std::uint8_t allowed);
  template <class Number>
  R4LINK_PRIVATE DatagramWriter& number(Number value, char* (*write)(char*, Number));

  char* begin_;
  char* at_;
  char* end_;
  bool ok_ = true;
  bool open_;       // a field is being written
  bool has_value_;  // it has a value already
};

}  // namespace r4
