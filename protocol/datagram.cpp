// SPDX-License-Identifier: GPL-3.0-or-later
#include "datagram.hpp"

#include "crc32.hpp"
#include "grammar.hpp"
#include "numbers.hpp"

namespace r4 {
namespace {

Text between(const char* from, const char* to) {
  return Text(from, static_cast<std::size_t>(to - from));
}

const char* find_byte(const char* at, const char* end, char byte) {
  if (at == end) return end;
  const void* const found = std::memchr(at, byte, static_cast<std::size_t>(end - at));
  return found == nullptr ? end : static_cast<const char*>(found);
}

Text without_line_end(Text bytes) {
  std::size_t size = bytes.size();
  if (size != 0 && bytes[size - 1] == '\n') --size;
  if (size != 0 && bytes[size - 1] == '\r') --size;
  return bytes.substr(0, size);
}

// What stands behind the fields.
struct Trailer {
  const char* digits = nullptr;  // the checksum's first digit
  std::uint32_t crc = 0;
  const char* error = nullptr;  // the byte that is not of the trailer, nullptr if all are
};

Trailer read_trailer(const char* at, const char* end) {
  Trailer trailer;
  const Text opening("^0x");
  for (const char expected : opening) {
    if (at == end || *at != expected) {
      trailer.error = at;
      return trailer;
    }
    ++at;
  }
  trailer.digits = at;
  const char* const close = find_byte(at, end, '^');
  if (!parse_hex(between(at, close), trailer.crc)) {
    trailer.error = at;
  } else if (close == end || close + 1 != end) {
    trailer.error = close == end ? end : close + 1;
  }
  return trailer;
}

}  // namespace

const char* to_text(ReadError error) {
  switch (error) {
    case ReadError::none:
      break;
    case ReadError::length:
      return "length";
    case ReadError::syntax:
      return "syntax";
    case ReadError::crc:
      return "crc";
  }
  return "";
}

std::size_t Field::count() const { return split(nullptr, 0); }

std::size_t Field::split(Text* out, std::size_t max) const {
  const char* at = values_.begin();
  for (std::size_t count = 0;;) {
    const char* const comma = find_byte(at, values_.end(), ',');
    if (count < max) out[count] = between(at, comma);
    ++count;
    if (comma == values_.end()) return count;
    at = comma + 1;
  }
}

bool read_field(Text text, Field& out) {
  const char* const colon = skip_name(text.begin(), text.end());
  if (colon == text.begin() || colon == text.end() || *colon != ':') return false;
  if (skip_values(colon + 1, text.end()) != text.end()) return false;
  out = Field(between(text.begin(), colon), between(colon + 1, text.end()));
  return true;
}

// The fields were checked by read(), so the separators are there.
void Datagram::Iterator::advance() {
  if (at_ == end_) return;
  const char* colon = at_;
  while (*colon != ':') ++colon;
  const char* semicolon = colon + 1;
  while (*semicolon != ';') ++semicolon;
  field_ = Field(between(at_, colon), between(colon + 1, semicolon));
  next_ = semicolon + 1;
}

Field Datagram::find(Text name) const {
  for (const Field& field : *this) {
    if (field.name() == name) return field;
  }
  return Field();
}

ReadResult read(Text bytes, Datagram& out) {
  ReadResult result;
  const Text whole = without_line_end(bytes);
  const auto fail = [&](ReadError error, const char* where) {
    result.error = error;
    result.position = static_cast<std::size_t>(where - whole.begin());
    return result;
  };
  if (whole.empty()) return fail(ReadError::length, whole.begin());
  if (whole.size() > max_datagram) return fail(ReadError::length, whole.begin() + max_datagram);

  const char* const fields_end = find_byte(whole.begin(), whole.end(), '^');
  const Trailer trailer = read_trailer(fields_end, whole.end());
  if (trailer.error != nullptr) return fail(ReadError::syntax, trailer.error);

  const std::uint32_t crc = crc32(between(whole.begin(), fields_end + 1));
  if (crc != trailer.crc) {
    result.crc_expected = crc;
    result.crc_found = trailer.crc;
    return fail(ReadError::crc, trailer.digits);
  }

  Datagram datagram;
  datagram.bytes_ = whole;
  datagram.fields_ = between(whole.begin(), fields_end);
  if (datagram.fields_.empty()) return fail(ReadError::syntax, fields_end);
  for (const char* at = whole.begin(); at != fields_end;) {
    const char* const colon = skip_name(at, fields_end);
    if (colon == at || *colon != ':') return fail(ReadError::syntax, colon);
    const char* const semicolon = skip_values(colon + 1, fields_end);
    if (*semicolon != ';') return fail(ReadError::syntax, semicolon);
    const Text name = between(at, colon);
    const Text value = between(colon + 1, semicolon);
    if (name == Text("PNum")) {
      if (datagram.has_pnum_) return fail(ReadError::syntax, at);
      if (!parse_number(value, datagram.pnum_)) return fail(ReadError::syntax, value.begin());
      datagram.has_pnum_ = true;
    } else if (name == Text("T")) {
      if (datagram.has_time_) return fail(ReadError::syntax, at);
      if (!parse_number(value, datagram.time_ms_)) return fail(ReadError::syntax, value.begin());
      datagram.has_time_ = true;
    }
    at = semicolon + 1;
  }
  out = datagram;
  return result;
}

}  // namespace r4
