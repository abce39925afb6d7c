// SPDX-License-Identifier: GPL-3.0-or-later
// The reading half of packed_form.hpp.
#include "../../../protocol/datagram/grammar.hpp"
#include "../../../protocol/datagram/numbers.hpp"
#include "packed_layout.hpp"
#include "r4link/messages/packed_form.hpp"

namespace r4 {
namespace packed {
namespace {

class Digits {
 public:
  Digits(const std::uint8_t* begin, const std::uint8_t* end)
      : bytes_(begin), size_(2 * static_cast<std::size_t>(end - begin)) {}

  std::size_t left() const { return size_ - at_; }
  // Reads at most 14 digits as a number; false if fewer are left.
  bool take(unsigned digits, std::uint64_t& value) {
    if (left() < digits) return false;
    value = 0;
    std::size_t at = at_;
    at_ += digits;
    if (digits != 0 && at % 2 != 0) value = bytes_[at++ / 2] & 0xFU;
    for (; at + 2 <= at_; at += 2) value = value << 8 | bytes_[at / 2];
    if (at != at_) value = value << 4 | bytes_[at / 2] >> 4;
    return true;
  }
  bool take(unsigned& digit) {
    if (left() == 0) return false;
    const unsigned byte = bytes_[at_ / 2];
    digit = at_ % 2 == 0 ? byte >> 4 : byte & 0xFU;
    ++at_;
    return true;
  }
  void put_back() { --at_; }

 private:
  const std::uint8_t* bytes_;
  std::size_t size_;  // number of digits
  std::size_t at_ = 0;
};

class Characters {
 public:
  Characters(char* out, std::size_t capacity) : begin_(out), at_(out), end_(out + capacity) {}

  void put(char c) {
    if (has_room(1)) *at_++ = c;
  }
  void put(const char* begin, std::size_t size) {
    if (!has_room(size)) return;
    std::memcpy(at_, begin, size);
    at_ += size;
  }
  void put(const PackedWord& word, std::size_t colon) {
    const std::size_t size = word.size + colon;
    if (room() >= sizeof word.text) {  // usual case: one copy of a fixed size
      std::memcpy(at_, word.text, sizeof word.text);
      at_ += size;
    } else {
      put(word.text, size);
    }
  }
  template <class Number>
  void put_number(Number value, char* (*write)(char*, Number)) {
    if (room() >= max_number_text) {
      at_ = write(at_, value);
      return;
    }
    char text[max_number_text];
    put(text, static_cast<std::size_t>(write(text, value) - text));
  }
  void put_plain(std::uint64_t value) {
    if (value <= 0xFFFFFFFFU) {
      put_number<std::uint32_t>(static_cast<std::uint32_t>(value), write_number);
    } else {
      put_number<std::uint64_t>(value, write_number);
    }
  }
  std::size_t size() const { return static_cast<std::size_t>(at_ - begin_); }
  bool overflow() const { return overflow_; }

 private:
  std::size_t room() const { return static_cast<std::size_t>(end_ - at_); }
  bool has_room(std::size_t size) {
    if (room() >= size) return true;
    overflow_ = true;
    end_ = at_;
    return false;
  }

  char* begin_;
  char* at_;
  char* end_;
  bool overflow_ = false;
};

bool take_bytes(Digits& digits, unsigned count, std::uint8_t byte_class, Characters& out) {
  for (; count != 0; --count) {
    std::uint64_t byte = 0;
    if (!digits.take(2, byte) || !is_in(byte_class, static_cast<char>(byte))) return false;
    out.put(static_cast<char>(byte));
  }
  return true;
}

bool take_word(Digits& digits, std::uint64_t& code) {
  return digits.take(2, code) && code < word_count;
}

bool take_text(Digits& digits, Characters& out) {
  for (unsigned digit = 0; digits.take(digit);) {
    if (digit < 10) {
      out.put(static_cast<char>('0' + digit));
      continue;
    }
    switch (digit) {
      case digit_point:
        out.put('.');
        break;
      case digit_minus:
        out.put('-');
        break;
      case digit_comma:
        out.put(',');
        break;
      case digit_end:
        return true;
      case digit_bytes: {
        unsigned count = 0;
        if (!digits.take(count) || count == 0 ||
            !take_bytes(digits, count, ByteClasses::in_value, out)) {
          return false;
        }
        break;
      }
      default: {
        std::uint64_t code = 0;
        if (!take_word(digits, code)) return false;
        out.put(words[code], 0);
      }
    }
  }
  return false;
}

// A count, whose first digit was taken. Not inlined: one copy is enough for rare values.
__attribute__((noinline)) bool take_count(Digits& digits, unsigned first, Characters& out) {
  std::uint64_t value = 0;
  if (first > longest_count || !digits.take(first, value)) return false;
  out.put_plain(value);
  out.put(',');
  return true;
}

__attribute__((noinline)) bool take_device_bytes(Digits& digits, unsigned first, Characters& out) {
  unsigned digit = 0;
  if (!take_count(digits, first, out)) return false;
  if (!digits.take(digit) || !take_count(digits, digit, out)) return false;
  out.put('x');
  unsigned count = 0;
  if (!digits.take(digit) || !digits.take(count)) return false;
  count |= digit << 4;
  if (count > most_device_bytes) return false;
  for (count *= 2; count != 0; --count) {
    if (!digits.take(digit)) return false;
    out.put(static_cast<char>(digit < 10 ? '0' + digit : 'a' + digit - 10));
  }
  return true;
}

bool take_session(Digits& digits, SessionId& sid) {
  std::uint64_t high = 0;
  if (!digits.take(session_id_size / 2, high) || !digits.take(session_id_size / 2, sid)) {
    return false;
  }
  sid |= high << 32;
  return sid != no_session;
}

bool take_value(Digits& digits, PackedForm form, Characters& out) {
  unsigned first = 0;
  std::uint64_t value = 0;
  if (form == PackedForm::text) return take_text(digits, out);
  if (!digits.take(first)) return false;
  if (first == digit_escape) return take_text(digits, out);
  switch (form) {
    case PackedForm::text:
    case PackedForm::flag:
      out.put_plain(first);
      return true;
    case PackedForm::short3:
      if (!digits.take(2, value)) return false;
      out.put_plain(first << 8 | value);
      return true;
    case PackedForm::hundredths:
      if (!digits.take(2, value)) return false;
      out.put_number<std::int32_t>(static_cast<std::int32_t>(first << 8 | value), write_hundredths);
      return true;
    case PackedForm::drive:
      if (!digits.take(3, value)) return false;
      value |= first << 12;
      out.put_plain(value >> 1);
      out.put((value & 1) != 0 ? ",1" : ",0", 2);
      return true;
    case PackedForm::bldc:
      if (!digits.take(3, value)) return false;
      value |= first << 12;
      out.put_plain(value >> 2);
      out.put((value & 2) != 0 ? ",1" : ",0", 2);
      out.put((value & 1) != 0 ? ",1" : ",0", 2);
      return true;
    case PackedForm::count:
      if (!digits.take(first, value)) return false;
      out.put_plain(value);
      return true;
    case PackedForm::steps:
      if (!digits.take(first, value)) return false;
      if ((value & 1) != 0) out.put('-');
      out.put_plain((value + 1) / 2);
      return true;
    case PackedForm::bytes:
      return take_device_bytes(digits, first, out);
    case PackedForm::session:
      if (first != 0 || !take_session(digits, value)) return false;
      out.put_number<SessionId>(value, write_session_id);
      return true;
  }
  return false;
}

bool take_name(Digits& digits, PackedForm& form, Characters& out) {
  unsigned first = 0;
  std::uint64_t code = 0;
  if (!digits.take(first)) return false;
  if (first != digit_name) {
    digits.put_back();
    if (!take_word(digits, code)) return false;
    form = words[code].form;
    out.put(words[code], 1);
    return true;
  }
  form = PackedForm::text;
  unsigned count = 0;
  if (!digits.take(count) || count == 0 || count > longest_name ||
      !take_bytes(digits, count, ByteClasses::in_name, out)) {
    return false;
  }
  out.put(':');
  return true;
}

bool take_fields(Digits& digits, Layout layout, Characters& out) {
  const unsigned nameless = nameless_fields(layout);
  for (unsigned index = 0; index < nameless || digits.left() >= 2; ++index) {
    PackedForm form = PackedForm::text;
    if (index < nameless) {
      const PackedWord& name = words[nameless_code(layout, index)];
      form = name.form;
      out.put(name, 1);
    } else if (!take_name(digits, form, out)) {
      return false;
    }
    if (!take_value(digits, form, out)) return false;
    out.put(';');
  }
  unsigned filler = 0xF;
  return digits.left() == 0 || (digits.take(filler) && filler == 0xF);
}

struct Numbers {
  std::uint64_t pnum = 0;
  std::uint64_t time = 0;
  SessionId sid = no_session;
};

void put_numbers(Layout layout, const Numbers& numbers, Characters& out) {
  if (has_session(layout)) {
    out.put("SID:", 4);
    out.put_number<SessionId>(numbers.sid, write_session_id);
    out.put(';');
  }
  out.put("PNum:", 5);
  out.put_plain(numbers.pnum);
  out.put(';');
  if (layout == Layout::of_session) return;
  out.put("T:", 2);
  out.put_plain(numbers.time);
  out.put(';');
}

bool take_datagram(Digits& digits, Layout layout, unsigned size, Characters& out) {
  if (layout == Layout::plain_fields) {
    return size == 0 && digits.left() >= 2 && take_fields(digits, layout, out);
  }
  Numbers numbers;
  if (layout == Layout::of_session && size != 0) return false;
  const Sizes sizes = sizes_of(layout, size);
  if (!digits.take(sizes.pnum, numbers.pnum) || !digits.take(sizes.time, numbers.time) ||
      (has_session(layout) && !take_session(digits, numbers.sid))) {
    return false;
  }
  if (is_heartbeat(layout)) {
    out.put("H:", 2);
    out.put(words[layout == Layout::board_heartbeat ? code_r4_ros2 : code_ros2_r4], 0);
    out.put(';');
    put_numbers(layout, numbers, out);
    return take_fields(digits, layout, out);
  }
  if (!take_fields(digits, layout, out)) return false;
  put_numbers(layout, numbers, out);
  return true;
}

UnpackResult failed(UnpackError error) {
  UnpackResult result;
  result.error = error;
  return result;
}

UnpackResult read_packed(const std::uint8_t* bytes, std::size_t size, char* out,
                         std::size_t capacity) {
  if (size == 0 || size > max_datagram) return failed(UnpackError::length);
  const unsigned head = bytes[0];
  const auto layout = static_cast<Layout>(head >> 3 & 7U);
  if ((head & version_mask) != version_bits) return failed(UnpackError::version);
  if (size < 1 + checksum_size) return failed(UnpackError::length);

  const std::uint8_t* const end = bytes + size - checksum_size;
  Digits digits(bytes + 1, end);
  Characters characters(out, capacity < max_datagram ? capacity : max_datagram);
  const bool good = take_datagram(digits, layout, head & 7U, characters);
  if (!good && !characters.overflow()) return failed(UnpackError::syntax);
  const std::uint32_t checksum = std::uint32_t{end[0]} << 24 | std::uint32_t{end[1]} << 16 |
                                 std::uint32_t{end[2]} << 8 | std::uint32_t{end[3]};
  characters.put("^0x", 3);
  characters.put_number<std::uint32_t>(checksum, write_hex);
  characters.put('^');
  if (characters.overflow()) return failed(UnpackError::length);
  UnpackResult result;
  result.size = characters.size();
  return result;
}

}  // namespace
}  // namespace packed

const char* to_text(UnpackError error) {
  switch (error) {
    case UnpackError::none:
      return "";
    case UnpackError::length:
      return "length";
    case UnpackError::version:
      return "version";
    case UnpackError::syntax:
      return "syntax";
  }
  return "unknown";
}

UnpackResult unpack(const std::uint8_t* bytes, std::size_t size, char* out, std::size_t capacity) {
  return packed::read_packed(bytes, size, out, capacity);
}

}  // namespace r4
