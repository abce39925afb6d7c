// SPDX-License-Identifier: GPL-3.0-or-later
// A datagram on the wire, checked and read in place (paper section 4; docs/reference/protocol.md).
//     datagram = 1*field "^0x" 1*8HEXDIG "^" [CR] [LF]
//     field    = name ":" value *("," value) ";"
//     name     = 1*(%x21-7E except ":" ";" "," "^")
//     value    = *(%x20-7E except ";" "," "^")
//
// read_datagram() accepts a whole datagram or nothing. A Datagram is a view: valid as long as the
// bytes. Reading allocates nothing, and takes one pass over the bytes and one pass for the CRC.
#pragma once

#include <cstddef>
#include <cstdint>

#include "config.hpp"
#include "text.hpp"
#include "vocabulary.hpp"

namespace r4 {

// The longest datagram in bytes, without the terminator (docs/reference/protocol.md).
constexpr std::size_t max_datagram = 1024;

enum class ReadError : std::uint8_t {
  none,
  length,  // empty, or longer than max_datagram
  syntax,  // does not match the grammar above
  crc,     // the checksum does not match
};

// "length", "syntax", "crc"; "" for none.
R4LINK_API const char* to_text(ReadError error);

// `position`: byte offset of the error; for crc, of the checksum's first digit.
struct ReadResult {
  ReadError error = ReadError::none;
  std::size_t position = 0;
  std::uint32_t crc_expected = 0;  // computed from the bytes
  std::uint32_t crc_found = 0;     // from the end of the datagram
  explicit operator bool() const { return error == ReadError::none; }
};

class R4LINK_API Field {
 public:
  Field() = default;
  Field(Text name, Text values) : name_(name), values_(values) {}
  Text name() const { return name_; }
  Text values() const { return values_; }  // all, commas included
  std::size_t count() const;               // number of values, at least 1
  // Writes the first `max` values to `out`; returns count(), which may be larger than `max`.
  std::size_t split(Text* out, std::size_t max) const;

 private:
  Text name_;
  Text values_;
};

// True if a field of this name is a command. T (time) and A (authentication) are not.
constexpr bool is_command_letter(char c) {
  return ((c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z')) && c != 'T' && c != 'A';
}

inline bool is_command(const Field& field) {
  return field.name().size() == 1 && is_command_letter(field.name()[0]);
}

// Reads a field without semicolon, "O:358,1,1". False if invalid; `out` is written only on success.
R4LINK_API bool read_field(Text text, Field& out);

class R4LINK_API Datagram {
 public:
  // Forward iteration over the fields in wire order. Valid as long as the Datagram.
  class Iterator {
   public:
    const Field& operator*() const { return field_; }
    const Field* operator->() const { return &field_; }
    Iterator& operator++() {
      at_ = field_.values().end() + 1;
      if (at_ != end_) load();
      return *this;
    }
    friend bool operator==(const Iterator& a, const Iterator& b) { return a.at_ == b.at_; }
    friend bool operator!=(const Iterator& a, const Iterator& b) { return a.at_ != b.at_; }

   private:
    friend class Datagram;
    explicit Iterator(const char* end) : at_(end), end_(end) {}
    explicit Iterator(const Datagram& datagram);
    void load();
    const char* next_end();

    const char* at_;
    const char* end_;
    // The ends of the next names and fields, in the current word.
    const std::uint64_t* word_ = nullptr;
    std::uint64_t ends_ = 0;
    const char* word_begin_ = nullptr;
    Field field_;
  };

  Datagram() = default;
  Datagram(const Datagram& other) { *this = other; }
  Datagram& operator=(const Datagram& other);

  Iterator begin() const { return facts_.fields.empty() ? end() : Iterator(*this); }
  Iterator end() const { return Iterator(facts_.fields.end()); }

  // The datagram's bytes without the line terminator.
  Text bytes() const { return facts_.bytes; }
  // The first field of that name. If there is no such field: a Field with an empty name.
  Field find(Text name) const;

  // The checksum in the datagram: of all bytes up to and including the first `^`.
  std::uint32_t checksum() const { return facts_.checksum; }
  // PNum and T, if present. A host heartbeat may lack PNum.
  bool has_pnum() const { return facts_.has_pnum; }
  std::uint32_t pnum() const { return facts_.pnum; }
  bool has_time() const { return facts_.has_time; }
  std::uint64_t time_ms() const { return facts_.time_ms; }
  // The session id (SID). If the datagram has no SID: no_session.
  SessionId session_id() const { return facts_.sid; }
  // The number of fields whose names are command letters (0 or more), and the first such field.
  int command_count() const { return facts_.command_count; }
  const Field& command() const { return facts_.command; }

 private:
  friend ReadResult read_datagram(Text bytes, Datagram& out);
  // Reads PNum, T and SID, and finds the command letters among the names whose ends are in
  // `short_names`. Returns the place of an invalid number, or nullptr.
  const char* read_short_names(const std::uint64_t* short_names);
  Text values_at(std::size_t word, std::uint64_t bit) const;

  struct Facts {
    Text bytes;
    Text fields;
    std::uint64_t time_ms = 0;
    SessionId sid = no_session;
    std::uint32_t checksum = 0;
    std::uint32_t pnum = 0;
    bool has_pnum = false;
    bool has_time = false;
    int command_count = 0;
    Field command;
  };

  Facts facts_;
  // Bit i of word k is set if byte 64 k + i of the fields ends a name (':') or a field (';'). Only
  // the words that the fields need are written or read.
  static constexpr std::size_t words = max_datagram / 64;
  std::uint64_t ends_[words];
};

// `bits` must not be 0. On a 32-bit processor, __builtin_ctzll() would call a function.
inline int lowest_bit(std::uint64_t bits) {
#if UINTPTR_MAX > 0xFFFFFFFFU
  return __builtin_ctzll(bits);
#else
  const std::uint32_t low = static_cast<std::uint32_t>(bits);
  return low != 0 ? __builtin_ctz(low) : 32 + __builtin_ctz(static_cast<std::uint32_t>(bits >> 32));
#endif
}

inline const char* Datagram::Iterator::next_end() {
  while (ends_ == 0) {
    ends_ = *++word_;
    word_begin_ += 64;
  }
  const char* const at = word_begin_ + lowest_bit(ends_);
  ends_ &= ends_ - 1;
  return at;
}

inline Datagram::Iterator::Iterator(const Datagram& datagram)
    : at_(datagram.facts_.fields.begin()),
      end_(datagram.facts_.fields.end()),
      word_(datagram.ends_),
      ends_(datagram.ends_[0]),
      word_begin_(at_) {
  load();
}

inline void Datagram::Iterator::load() {
  const char* const colon = next_end();
  const char* const semicolon = next_end();
  field_ = Field(Text(at_, static_cast<std::size_t>(colon - at_)),
                 Text(colon + 1, static_cast<std::size_t>(semicolon - colon - 1)));
}

// Checks one datagram, with or without a terminator, and on success makes `out` a view of it.
// Otherwise `out` is unchanged. Also returns `syntax` for a PNum (32 bit) or T (64 bit) that is not
// a whole number in range, for a SID that is 0 or not 16 hexadecimal digits, and for a duplicate
// PNum, T or SID.
R4LINK_API ReadResult read_datagram(Text bytes, Datagram& out);

}  // namespace r4
