// SPDX-License-Identifier: GPL-3.0-or-later
// The writing half of packed_form.hpp.
#include "../../../protocol/datagram/grammar.hpp"
#include "../../../protocol/datagram/numbers.hpp"
#include "packed_digits.hpp"
#include "packed_layout.hpp"
#include "r4link/messages/packed_form.hpp"

namespace r4 {
namespace packed {
namespace {

class Fields {
 public:
  Fields(Text fields, const std::uint64_t* ends)
      : at_(fields.begin()), word_begin_(at_), word_(ends), ends_(*ends) {}
  const char* at() const { return at_; }
  Field next() {
    const char* const colon = next_end();
    const char* const semicolon = next_end();
    const Field field(Text(at_, static_cast<std::size_t>(colon - at_)),
                      Text(colon + 1, static_cast<std::size_t>(semicolon - colon - 1)));
    at_ = semicolon + 1;
    return field;
  }

 private:
  const char* next_end() {
    while (ends_ == 0) {
      ends_ = *++word_;
      word_begin_ += separators_block;
    }
    const char* const at = word_begin_ + __builtin_ctzll(ends_);
    ends_ &= ends_ - 1;
    return at;
  }

  const char* at_;
  const char* word_begin_;
  const std::uint64_t* word_;
  std::uint64_t ends_;
};

unsigned digits_of(std::uint64_t value) {
  return value == 0 ? 0 : (67 - static_cast<unsigned>(__builtin_clzll(value))) / 4;
}

bool parse_plain(Text text, std::uint64_t& out) {
  return !text.empty() && (text[0] != '0' || text.size() == 1) && parse_number(text, out);
}

// Removes ",0" or ",1" from the end.
bool take_bit(Text& text, std::uint64_t& value, unsigned weight) {
  if (text.size() < 3) return false;
  const char* const last = text.end() - 1;
  if (last[-1] != ',' || (*last != '0' && *last != '1')) return false;
  if (*last == '1') value += weight;
  text = text.substr(0, text.size() - 2);
  return true;
}

bool put_fixed(DigitWriter& digits, std::uint64_t value, std::uint64_t max, unsigned count) {
  return value <= max && digits.put(value, count);
}

bool put_count(DigitWriter& digits, std::uint64_t value) {
  const unsigned count = digits_of(value);
  return count <= longest_count && digits.put(count, 1) && digits.put(value, count);
}

// `text`: all values of a field of a datagram, so a semicolon follows.
bool put_hundredths(DigitWriter& digits, Text text) {
  const char* at = text.begin();
  std::int32_t value = 0;
  // Exactly two decimals, no sign, no leading zero except directly before the point.
  return text.size() >= 4 && *(text.end() - 3) == '.' && (text[0] != '0' || text.size() == 4) &&
         take_hundredths(at, value) && at == text.end() && value >= 0 && text[0] != '-' &&
         put_fixed(digits, static_cast<std::uint64_t>(value), short3_max, 3);
}

bool put_steps(DigitWriter& digits, Text text) {
  std::uint64_t value = 0;
  const bool negative = !text.empty() && text[0] == '-';
  if (!parse_plain(negative ? text.substr(1) : text, value) || (negative && value == 0) ||
      digits_of(value) > longest_count) {
    return false;
  }
  return put_count(digits, negative ? 2 * value - 1 : 2 * value);
}

__attribute__((noinline)) bool take_plain(Text& text, std::uint64_t& out) {
  std::size_t size = 0;
  while (size < text.size() && text[size] != ',') ++size;
  if (size == text.size() || !parse_plain(text.substr(0, size), out)) return false;
  text = text.substr(size + 1);
  return true;
}

unsigned hex_digit_of(char c) {
  if (c >= '0' && c <= '9') return static_cast<unsigned>(c - '0');
  return c >= 'a' && c <= 'f' ? static_cast<unsigned>(c - 'a') + 10 : 16;
}

// Not inlined: one copy is enough for rare values.
__attribute__((noinline)) bool put_seldom(DigitWriter& digits, std::uint64_t value,
                                          unsigned count) {
  return digits.put(value, count);
}

__attribute__((noinline)) bool put_device_bytes(DigitWriter& digits, Text text) {
  std::uint64_t first = 0;
  std::uint64_t second = 0;
  if (!take_plain(text, first) || !take_plain(text, second)) return false;
  if (text.size() % 2 == 0 || text[0] != 'x' || text.size() / 2 > most_device_bytes) return false;
  for (std::size_t i = 1; i < text.size(); ++i) {
    if (hex_digit_of(text[i]) > 15) return false;
  }
  if ((first | second) > 0xFFFFFFFFU) return false;
  const unsigned first_digits = digits_of(first);
  const unsigned second_digits = digits_of(second);
  std::uint64_t head = std::uint64_t{first_digits} << 4 * first_digits | first;
  if (!put_seldom(digits, head, 1 + first_digits)) return false;
  head = (std::uint64_t{second_digits} << 4 * second_digits | second) << 8 | text.size() / 2;
  if (!put_seldom(digits, head, 3 + second_digits)) return false;
  for (std::size_t i = 1; i < text.size(); i += 2) {
    const unsigned byte = hex_digit_of(text[i]) << 4 | hex_digit_of(text[i + 1]);
    if (!put_seldom(digits, byte, 2)) return false;
  }
  return true;
}

bool put_session(DigitWriter& digits, SessionId sid) {
  return digits.put(sid >> 32, session_id_size / 2) &&
         digits.put(sid & 0xFFFFFFFFU, session_id_size / 2);
}

// Writes the value in the form of the field. False if the form would write a different text.
bool put_in_form(DigitWriter& digits, PackedForm form, Text text) {
  std::uint64_t value = 0;
  std::uint64_t bits = 0;
  switch (form) {
    case PackedForm::text:
      return false;
    case PackedForm::flag:
      return parse_plain(text, value) && put_fixed(digits, value, flag_max, 1);
    case PackedForm::short3:
      return parse_plain(text, value) && put_fixed(digits, value, short3_max, 3);
    case PackedForm::hundredths:
      return put_hundredths(digits, text);
    case PackedForm::drive:
      return take_bit(text, bits, 1) && parse_plain(text, value) && value <= drive_max &&
             put_fixed(digits, 2 * value + bits, drive_max, 4);
    case PackedForm::bldc:
      return take_bit(text, bits, 1) && take_bit(text, bits, 2) && parse_plain(text, value) &&
             value <= drive_max && put_fixed(digits, 4 * value + bits, drive_max, 4);
    case PackedForm::count:
      return parse_plain(text, value) && put_count(digits, value);
    case PackedForm::steps:
      return put_steps(digits, text);
    case PackedForm::bytes:
      return put_device_bytes(digits, text);
    case PackedForm::session:
      return parse_session_id(text, value) && digits.put(0, 1) && put_session(digits, value);
  }
  return false;
}

constexpr unsigned no_digit = 0xFF;

unsigned digit_of(char c) {
  if (c >= '0' && c <= '9') return static_cast<unsigned>(c - '0');
  return c == '.' ? digit_point : c == '-' ? digit_minus : no_digit;
}

// The end of a run of bytes: three digits, or digits to the end, cost less than another run.
const char* end_of_bytes(const char* at, const char* end) {
  const char* const limit =
      end - at > static_cast<std::ptrdiff_t>(longest_bytes) ? at + longest_bytes : end;
  while (at != limit) {
    const char* digits = at;
    while (digits != end && digits - at < 3 && digit_of(*digits) != no_digit) ++digits;
    if (digits - at == 3 || (digits == end && digits != at)) break;
    at = digits == at ? at + 1 : digits < limit ? digits : limit;
  }
  return at;
}

bool put_value(DigitWriter& digits, Text value) {
  const unsigned code = value.empty() || digit_of(value[0]) < 10 ? no_word : code_of(value);
  if (code != no_word) return digits.put(digit_word << 8 | code, 3);
  for (const char *at = value.begin(), *const end = value.end(); at != end;) {
    const unsigned digit = digit_of(*at);
    if (digit != no_digit) {
      if (!digits.put(digit, 1)) return false;
      ++at;
      continue;
    }
    const char* const stop = end_of_bytes(at, end);
    const auto count = static_cast<unsigned>(stop - at);
    if (!digits.put(digit_bytes << 4 | count, 2) || !digits.put_bytes(at, stop)) return false;
    at = stop;
  }
  return true;
}

bool put_text(DigitWriter& digits, Text values) {
  const char* at = values.begin();
  for (const char* end = at;; at = ++end) {
    while (end != values.end() && *end != ',') ++end;
    if (!put_value(digits, Text(at, static_cast<std::size_t>(end - at)))) return false;
    if (end == values.end()) return digits.put(digit_end, 1);
    if (!digits.put(digit_comma, 1)) return false;
  }
}

bool put_name(DigitWriter& digits, Text name, PackedForm& form) {
  const unsigned code = code_of(name);
  if (code != no_word) {
    form = words[code].form;
    return digits.put(code, 2);
  }
  form = PackedForm::text;
  const auto size = static_cast<unsigned>(name.size());
  return name.size() <= longest_name && digits.put(digit_name << 4 | size, 2) &&
         digits.put_bytes(name.begin(), name.end());
}

bool put_values(DigitWriter& digits, PackedForm form, Text values) {
  if (form == PackedForm::text) return put_text(digits, values);
  return put_in_form(digits, form, values) ||
         (digits.put(digit_escape, 1) && put_text(digits, values));
}

struct Numbers {
  SessionId sid = no_session;
  std::uint64_t pnum = 0;
  std::uint64_t time = 0;
  unsigned size = 0;  // index of `sizes`

  // False if the fields are not PNum and T in a form and size that a layout has.
  bool take(const Field& first, const Field& second) {
    if (first.name() != Text("PNum") || second.name() != Text("T") ||
        !parse_plain(first.values(), pnum) || !parse_plain(second.values(), time)) {
      return false;
    }
    const unsigned pnum_digits = digits_of(pnum);
    const unsigned time_digits = digits_of(time);
    for (size = 0; size < 8; ++size) {
      if (pnum_digits <= sizes[size].pnum && time_digits <= sizes[size].time) return true;
    }
    return false;
  }
  // PNum alone, for a command.
  bool take(const Field& only) {
    size = 0;
    return only.name() == Text("PNum") && parse_plain(only.values(), pnum) &&
           digits_of(pnum) <= session_sizes.pnum;
  }
};

bool is_session(const Field& field, Numbers& numbers) {
  return field.name() == Text("SID") && parse_session_id(field.values(), numbers.sid);
}

Field last_field(const char* begin, const char* end) {
  const char* at = end - 1;
  const char* colon = at;
  while (at != begin && at[-1] != ';') {
    --at;
    if (*at == ':') colon = at;
  }
  return Field(Text(at, static_cast<std::size_t>(colon - at)),
               Text(colon + 1, static_cast<std::size_t>(end - 1 - (colon + 1))));
}

// The layout of a datagram that ends in PNum and T. `end`: where PNum begins.
Layout layout_of(Fields fields, const char* end) {
  unsigned run = 0;
  Field field;
  while (run < state_words && fields.at() != end) {
    field = fields.next();
    if (field.name() != words[run].word()) break;
    ++run;
  }
  if (run < default_fields) return Layout::fields;
  if (run == state_words) return Layout::full_state;
  const bool safe_cmd = run == default_fields && field.name() == words[code_safe].word() &&
                        fields.at() != end && fields.next().name() == words[code_cmd].word();
  return safe_cmd ? Layout::state_safe_cmd : Layout::state;
}

bool is_heartbeat_of(const Field& field, unsigned code) {
  return field.name() == Text("H") && field.values() == words[code].word();
}

Layout choose_layout(Fields& fields, const char*& end, Numbers& numbers) {
  Fields after = fields;
  const Field first = after.next();
  const Layout heartbeat = is_heartbeat_of(first, code_r4_ros2)   ? Layout::board_heartbeat
                           : is_heartbeat_of(first, code_ros2_r4) ? Layout::host_heartbeat
                                                                  : Layout::plain_fields;
  if (heartbeat != Layout::plain_fields && after.at() != end) {
    Field second = after.next();
    const bool fits = !has_session(heartbeat) || is_session(second, numbers);
    if (has_session(heartbeat) && after.at() != end) second = after.next();
    if (fits && after.at() != end && numbers.take(second, after.next())) {
      fields = after;
      return heartbeat;
    }
  }
  const Field time = last_field(fields.at(), end);
  if (time.name().begin() == fields.at()) return Layout::plain_fields;
  const Field pnum = last_field(fields.at(), time.name().begin());
  if (numbers.take(pnum, time)) {
    end = pnum.name().begin();
    return layout_of(fields, end);
  }
  if (!is_session(pnum, numbers) || !numbers.take(time)) return Layout::plain_fields;
  end = pnum.name().begin();
  return Layout::of_session;
}

// Splits the datagram before "^0x"; false if its checksum is not as writers print it.
bool take_checksum(Text datagram, Text& fields, std::uint32_t& checksum) {
  if (datagram.size() < 8 || datagram.size() > max_datagram) return false;  // at least "A:;^0x0^"
  const char* const last = datagram.end() - 1;
  const char* first = last;
  while (last - first < 9 && first[-1] != 'x' && first - 4 != datagram.begin()) --first;
  if (*last != '^' || Text(first - 3, 3) != Text("^0x")) return false;
  const Text hex(first, static_cast<std::size_t>(last - first));
  if (!parse_hex(hex, checksum) || (hex[0] == '0' && hex.size() != 1)) return false;
  for (const char c : hex) {
    if (c >= 'A' && c <= 'F') return false;
  }
  fields = datagram.substr(0, static_cast<std::size_t>(first - 3 - datagram.begin()));
  return true;
}

std::size_t write_packed(Text datagram, std::uint8_t* out, std::size_t capacity) {
  Text text;
  std::uint32_t checksum = 0;
  std::uint64_t ends[max_datagram / separators_block];
  std::uint64_t short_names[max_datagram / separators_block];
  if (!take_checksum(datagram, text, checksum) || !mark_fields(text, ends, short_names)) return 0;
  const std::size_t limit = capacity < datagram.size() ? capacity : datagram.size() - 1;
  if (limit < 1 + checksum_size) return 0;

  Fields fields(text, ends);
  const char* end = text.end();
  Numbers numbers;
  const Layout layout = choose_layout(fields, end, numbers);
  DigitWriter digits(out + 1, out + limit - checksum_size);
  unsigned head = version_bits | static_cast<unsigned>(layout) << 3;
  if (layout != Layout::plain_fields) {
    head |= numbers.size;
    const Sizes sizes = sizes_of(layout, numbers.size);
    if (!digits.put(numbers.pnum, sizes.pnum) || !digits.put(numbers.time, sizes.time) ||
        (has_session(layout) && !put_session(digits, numbers.sid))) {
      return 0;
    }
  }
  out[0] = static_cast<std::uint8_t>(head);

  const unsigned nameless = nameless_fields(layout);
  for (unsigned index = 0; fields.at() != end; ++index) {
    const Field field = fields.next();
    PackedForm form = PackedForm::text;
    if (index < nameless) {
      form = words[nameless_code(layout, index)].form;
    } else if (!put_name(digits, field.name(), form)) {
      return 0;
    }
    if (!put_values(digits, form, field.values())) return 0;
  }
  std::uint8_t* at = digits.finish();
  for (int shift = 24; shift >= 0; shift -= 8) {
    *at++ = static_cast<std::uint8_t>(checksum >> shift);
  }
  return static_cast<std::size_t>(at - out);
}

}  // namespace
}  // namespace packed

std::size_t pack(Text datagram, std::uint8_t* out, std::size_t capacity) {
  return packed::write_packed(datagram, out, capacity);
}

}  // namespace r4
