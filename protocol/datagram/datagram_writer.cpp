// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/messages/datagram_writer.hpp"

#include "crc32.hpp"
#include "grammar.hpp"
#include "numbers.hpp"
#include "r4link/datagram.hpp"

namespace r4 {
namespace {

constexpr FieldName pnum_name("PNum");
constexpr FieldName time_name("T");
constexpr FieldName session_name("SID");

}  // namespace

bool DatagramWriter::reserve(std::size_t bytes) {
  if (static_cast<std::size_t>(end_ - at_) < bytes) ok_ = false;
  return ok_;
}

DatagramWriter& DatagramWriter::field(Text name) {
  if (name.empty() || !reserve(name.size() + 2)) {
    ok_ = false;
    return *this;
  }
  char* at = at_;
  if (open_) *at++ = ';';
  for (const char c : name) {
    if (!is_in(ByteClasses::in_name, c)) {
      ok_ = false;
      return *this;
    }
    *at++ = c;
  }
  *at++ = ':';
  at_ = at;
  open_ = true;
  has_value_ = false;
  return *this;
}

DatagramWriter& DatagramWriter::field(const FieldName& name) {
  if (static_cast<std::size_t>(end_ - at_) <= sizeof name.text_) return field(name.name());
  if (!ok_) return *this;
  *at_ = ';';
  at_ += open_ ? 1 : 0;
  // Copies all of text_, because the compiler knows its size. Later bytes overwrite the excess.
  std::memcpy(at_, name.text_, sizeof name.text_);
  at_ += name.size_ + 1;
  open_ = true;
  has_value_ = false;
  return *this;
}

DatagramWriter& DatagramWriter::append(Text text, std::uint8_t allowed) {
  if (!open_ || !reserve(text.size() + 1)) {
    ok_ = false;
    return *this;
  }
  char* at = at_;
  if (has_value_) *at++ = ',';
  for (const char c : text) {
    if (!is_in(allowed, c)) {
      ok_ = false;
      return *this;
    }
    *at++ = c;
  }
  at_ = at;
  has_value_ = true;
  return *this;
}

DatagramWriter& DatagramWriter::value(Text text) { return append(text, ByteClasses::in_value); }
DatagramWriter& DatagramWriter::values(Text text) { return append(text, ByteClasses::in_values); }

DatagramWriter& DatagramWriter::more(Text text) {
  if (!has_value_) ok_ = false;
  has_value_ = false;
  append(text, ByteClasses::in_value);
  has_value_ = true;
  return *this;
}

template <class Number>
DatagramWriter& DatagramWriter::number(Number value, char* (*write)(char*, Number)) {
  if (static_cast<std::size_t>(end_ - at_) <= max_number_text) {
    // Near the end of the buffer, write beside it first, to find out whether the number fits.
    char beside[max_number_text];
    return values(Text(beside, static_cast<std::size_t>(write(beside, value) - beside)));
  }
  if (!ok_ || !open_) {
    ok_ = false;
    return *this;
  }
  char* at = at_;
  if (has_value_) *at++ = ',';
  at_ = write(at, value);
  has_value_ = true;
  return *this;
}

DatagramWriter& DatagramWriter::value(std::uint32_t value) { return number(value, write_number); }
DatagramWriter& DatagramWriter::value(std::int32_t value) { return number(value, write_number); }
DatagramWriter& DatagramWriter::value(std::uint64_t value) { return number(value, write_number); }
DatagramWriter& DatagramWriter::hundredths(std::int32_t value) {
  return number(value, write_hundredths);
}

void DatagramWriter::truncate(std::size_t size) {
  at_ = begin_ + size;
  ok_ = true;
  open_ = size != 0;
  has_value_ = open_;
}

DatagramWriter& DatagramWriter::session(SessionId sid) {
  if (sid == no_session) return *this;
  char digits[session_id_size];
  write_session_id(digits, sid);
  return field(session_name).value(Text(digits, sizeof digits));
}

DatagramWriter& DatagramWriter::stamp(std::uint32_t pnum, std::uint64_t t_ms) {
  return packet(pnum).field(time_name).value(t_ms);
}

DatagramWriter& DatagramWriter::packet(std::uint32_t pnum) { return field(pnum_name).value(pnum); }

Text DatagramWriter::finish(std::uint32_t pnum, std::uint64_t t_ms) {
  stamp(pnum, t_ms);
  return finish();
}

Text DatagramWriter::finish() {
  constexpr std::size_t shortest = 6;  // ";^0x0^"
  if (!open_ || !reserve(shortest)) {
    ok_ = false;
    return Text();
  }
  *at_++ = ';';
  *at_++ = '^';
  char rest[11];  // "0xffffffff^"
  rest[0] = '0';
  rest[1] = 'x';
  char* at = write_hex(rest + 2, crc32(Text(begin_, size())));
  *at++ = '^';
  const std::size_t rest_size = static_cast<std::size_t>(at - rest);
  if (size() + rest_size > max_datagram || !reserve(rest_size)) {
    ok_ = false;
    return Text();
  }
  std::memcpy(at_, rest, rest_size);
  at_ += rest_size;
  open_ = false;
  return Text(begin_, size());
}

}  // namespace r4
