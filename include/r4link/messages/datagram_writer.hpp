// SPDX-License-Identifier: GPL-3.0-or-later
// Writes one datagram into the caller's buffer.
//     char buffer[max_datagram];
//     DatagramWriter w(buffer, sizeof buffer);
//     w.field("O").value(358).value(1).value(1);
//     Text datagram = w.finish(pnum, t_ms);   // "O:358,1,1;PNum:66;T:79146;^0x…^"
//
// If the datagram does not fit, or a name or text has bytes that the grammar (datagram.hpp)
// forbids, finish() returns an empty Text. So a text cannot forge a field.
#pragma once

#include <cstddef>
#include <cstdint>

#include "../config.hpp"
#include "../text.hpp"
#include "../vocabulary.hpp"

namespace r4 {

// A field name as a compile-time constant in wire form, "OSMC1:", so that writing needs no check
// and no loop. A name of more than 10 characters does not compile.
class FieldName {
 public:
  constexpr FieldName() = default;
  explicit constexpr FieldName(Text name) : size_(static_cast<std::uint8_t>(name.size())) {
    for (std::size_t i = 0; i < name.size(); ++i) text_[i] = name[i];
    text_[name.size()] = ':';  // outside of text_ if the name is too long
  }
  constexpr Text name() const { return Text(text_, size_); }
  // True if the grammar allows the name; for a static_assert.
  constexpr bool allowed() const {
    if (size_ == 0 || size_ > 10) return false;
    for (int i = 0; i < size_; ++i) {
      const char c = text_[i];
      if (c <= ' ' || c > '~' || c == ':' || c == ';' || c == ',' || c == '^') return false;
    }
    return true;
  }

 private:
  friend class DatagramWriter;
  char text_[11] = {};
  std::uint8_t size_ = 0;
};

class R4LINK_API DatagramWriter {
 public:
  // Continues after the first `used` bytes of the buffer. `used`: size() of an earlier writer.
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
  DatagramWriter& hundredths(std::int32_t value);  // 2428: "24.28"
  // Writes a text that may hold commas: "ROS2-R4", "a,b".
  DatagramWriter& values(Text text);

  // Continues the last value.
  DatagramWriter& more(Text text);

  // The bytes written so far. ok(): all bytes fitted and were allowed.
  std::size_t size() const { return static_cast<std::size_t>(at_ - begin_); }
  Text written() const { return Text(begin_, size()); }
  bool ok() const { return ok_; }

  // Removes the bytes after `size`, a size() before a field() while ok(). Restores ok().
  void truncate(std::size_t size);

  // Writes SID, to be called before packet() or stamp(); no effect for no_session.
  DatagramWriter& session(SessionId sid);
  // Writes PNum, the last field of a session's command before a signature (authentication.hpp).
  DatagramWriter& packet(std::uint32_t pnum);
  // Writes PNum and T, the last fields of any other datagram before a signature.
  DatagramWriter& stamp(std::uint32_t pnum, std::uint64_t t_ms);
  // Adds PNum, T and the CRC. Empty if ok() is false, or the datagram is too long.
  Text finish(std::uint32_t pnum, std::uint64_t t_ms);
  // Adds only the CRC: the caller has written PNum and T.
  Text finish();

  // The most that finish(pnum, t) adds: ";PNum:4294967295;T:18446744073709551615;^0xffffffff^".
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
  bool open_;
  bool has_value_;  // the open field has a value
};

}  // namespace r4
