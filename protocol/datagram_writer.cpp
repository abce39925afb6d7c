// SPDX-License-Identifier: GPL-3.0-or-later
#include "datagram_writer.hpp"

#include "crc32.hpp"
#include "datagram.hpp"
#include "grammar.hpp"
#include "numbers.hpp"

namespace r4 {

bool DatagramWriter::reserve(std::size_t bytes) {
  if (static_cast<std::size_t>(end_ - at_) < bytes) ok_ = false;
  return ok_;
}

void DatagramWriter::separator() {
  if (has_value_) *at_++ = ',';
  has_value_ = true;
}

DatagramWriter& DatagramWriter::field(Text name) {
  if (name.empty() || skip_name(name.begin(), name.end()) != name.end()) ok_ = false;
  if (!reserve(name.size() + 2)) return *this;
  if (open_) *at_++ = ';';
  std::memcpy(at_, name.data(), name.size());
  at_ += name.size();
  *at_++ = ':';
  open_ = true;
  has_value_ = false;
  return *this;
}

DatagramWriter& DatagramWriter::value(Text text) {
  if (skip_value(text.begin(), text.end()) != text.end()) ok_ = false;
  return values(text);
}

DatagramWriter& DatagramWriter::values(Text text) {
  if (!open_ || skip_values(text.begin(), text.end()) != text.end()) ok_ = false;
  if (!reserve(text.size() + 1)) return *this;
  separator();
  if (!text.empty()) std::memcpy(at_, text.data(), text.size());
  at_ += text.size();
  return *this;
}

template <class Number>
DatagramWriter& DatagramWriter::number(Number value, char* (*write)(char*, Number)) {
  if (!open_) ok_ = false;
  // Near the end of the buffer the number is made beside it, to see whether it fits.
  char beside[max_number_text];
  const bool roomy = static_cast<std::size_t>(end_ - at_) > max_number_text;
  if (roomy && ok_) {
    separator();
    at_ = write(at_, value);
  } else {
    values(Text(beside, static_cast<std::size_t>(write(beside, value) - beside)));
  }
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

Text DatagramWriter::finish(std::uint32_t pnum, std::uint64_t t_ms) {
  field("PNum").value(pnum);
  field("T").value(t_ms);
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
