// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/datagram.hpp"

#include "crc32.hpp"
#include "grammar.hpp"
#include "numbers.hpp"

namespace r4 {
namespace {

Text between(const char* from, const char* to) {
  return Text(from, static_cast<std::size_t>(to - from));
}

const char* find_byte(const char* at, const char* end, char byte) {
  while (at != end && *at != byte) ++at;
  return at;
}

Text without_line_end(Text bytes) {
  std::size_t size = bytes.size();
  if (size != 0 && bytes[size - 1] == '\n') --size;
  if (size != 0 && bytes[size - 1] == '\r') --size;
  return bytes.substr(0, size);
}

struct Trailer {
  const char* digits = nullptr;
  std::uint32_t crc = 0;
  const char* error = nullptr;  // first wrong byte; nullptr if the trailer is valid
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

// The first byte that breaks the grammar; `fields.end()` if the last field is not closed.
const char* first_wrong_byte(Text fields) {
  const char* at = fields.begin();
  do {
    const char* const colon = skip(ByteClasses::in_name, at, fields.end());
    if (colon == at || colon == fields.end() || *colon != ':') return colon;
    at = skip(ByteClasses::in_values, colon + 1, fields.end());
    if (at == fields.end() || *at != ';') return at;
    ++at;
  } while (at != fields.end());
  return at;
}

// Reads a number that may occur once. Returns the wrong byte; nullptr: no wrong byte.
template <class Number>
const char* take_number(Text name, Text value, bool& has, Number& number) {
  if (has) return name.begin();
  has = true;
  return parse_number(value, number) ? nullptr : value.begin();
}

const char* take_session_id(Text name, Text value, SessionId& sid) {
  if (sid != no_session) return name.begin();
  return parse_session_id(value, sid) ? nullptr : value.begin();
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
  const char* const colon = skip(ByteClasses::in_name, text.begin(), text.end());
  if (colon == text.begin() || colon == text.end() || *colon != ':') return false;
  if (skip(ByteClasses::in_values, colon + 1, text.end()) != text.end()) return false;
  out = Field(between(text.begin(), colon), between(colon + 1, text.end()));
  return true;
}

Datagram& Datagram::operator=(const Datagram& other) {
  if (this == &other) return *this;
  const std::size_t size = other.facts_.fields.size();
  for (std::size_t word = 0; word * 64 < size; ++word) ends_[word] = other.ends_[word];
  // Member by member, because GCC copies the whole struct with a slow string instruction.
  const Facts& from = other.facts_;
  facts_.bytes = from.bytes;
  facts_.fields = from.fields;
  facts_.time_ms = from.time_ms;
  facts_.sid = from.sid;
  facts_.checksum = from.checksum;
  facts_.pnum = from.pnum;
  facts_.has_pnum = from.has_pnum;
  facts_.has_time = from.has_time;
  facts_.command_count = from.command_count;
  facts_.command = from.command;
  return *this;
}

Field Datagram::find(Text name) const {
  for (const Field& field : *this) {
    if (field.name() == name) return field;
  }
  return Field();
}

Text Datagram::values_at(std::size_t word, std::uint64_t bit) const {
  const char* const colon = facts_.fields.begin() + word * 64 + lowest_bit(bit);
  std::uint64_t later = ends_[word] & ~(bit | (bit - 1));
  while (later == 0) later = ends_[++word];
  return between(colon + 1, facts_.fields.begin() + word * 64 + lowest_bit(later));
}

const char* Datagram::read_short_names(const std::uint64_t* short_names) {
  constexpr Text pnum("PNum");
  constexpr Text sid("SID");
  for (std::size_t word = 0; word * 64 < facts_.fields.size(); ++word) {
    for (std::uint64_t left = short_names[word]; left != 0; left &= left - 1) {
      const std::uint64_t bit = left & (0 - left);
      const char* const colon = facts_.fields.begin() + word * 64 + lowest_bit(bit);
      const char* wrong = nullptr;
      if (colon - 1 == facts_.fields.begin() || colon[-2] == ';') {
        const Text name(colon - 1, 1);
        if (name[0] == 'T') {
          wrong = take_number(name, values_at(word, bit), facts_.has_time, facts_.time_ms);
        } else if (is_command_letter(name[0])) {
          if (facts_.command_count == 0) facts_.command = Field(name, values_at(word, bit));
          ++facts_.command_count;
        }
      } else if (colon - 3 == facts_.fields.begin() || colon[-4] == ';') {
        const Text name(colon - 3, 3);
        if (name == sid) wrong = take_session_id(name, values_at(word, bit), facts_.sid);
      } else {  // four letters
        const Text name(colon - 4, 4);
        if (name == pnum) {
          wrong = take_number(name, values_at(word, bit), facts_.has_pnum, facts_.pnum);
        }
      }
      if (wrong != nullptr) return wrong;
    }
  }
  return nullptr;
}

ReadResult read_datagram(Text bytes, Datagram& out) {
  ReadResult result;
  const Text whole = without_line_end(bytes);
  const auto fail = [&](ReadError error, const char* where) {
    result.error = error;
    result.position = static_cast<std::size_t>(where - whole.begin());
    return result;
  };
  if (whole.empty()) return fail(ReadError::length, whole.begin());
  if (whole.size() > max_datagram) return fail(ReadError::length, whole.begin() + max_datagram);

  const void* const caret = std::memchr(whole.data(), '^', whole.size());
  const char* const fields_end = caret == nullptr ? whole.end() : static_cast<const char*>(caret);
  const Trailer trailer = read_trailer(fields_end, whole.end());
  if (trailer.error != nullptr) return fail(ReadError::syntax, trailer.error);

  const std::uint32_t crc = crc32(between(whole.begin(), fields_end + 1));
  if (crc != trailer.crc) {
    result.crc_expected = crc;
    result.crc_found = trailer.crc;
    return fail(ReadError::crc, trailer.digits);
  }

  const Text fields = between(whole.begin(), fields_end);
  Datagram datagram;
  std::uint64_t short_names[Datagram::words];
  if (!mark_fields(fields, datagram.ends_, short_names)) {
    return fail(ReadError::syntax, first_wrong_byte(fields));
  }
  datagram.facts_.bytes = whole;
  datagram.facts_.fields = fields;
  datagram.facts_.checksum = crc;
  const char* const wrong = datagram.read_short_names(short_names);
  if (wrong != nullptr) return fail(ReadError::syntax, wrong);
  out = datagram;
  return result;
}

}  // namespace r4
