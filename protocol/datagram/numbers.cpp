// SPDX-License-Identifier: GPL-3.0-or-later
#include "numbers.hpp"

namespace r4 {
namespace {

constexpr std::uint64_t u32_max = 0xFFFFFFFFU;
constexpr std::uint64_t u64_max = ~std::uint64_t{0};

inline bool parse_short(const char* at, const char* end, std::uint32_t& out) {
  std::uint32_t value = 0;
  do {
    const unsigned digit = digit_value(*at);
    if (digit > 9) return false;
    value = value * 10 + digit;
  } while (++at != end);
  out = value;
  return true;
}

inline bool parse_digits(const char* at, const char* end, std::uint64_t limit, std::uint64_t& out) {
  constexpr std::uint32_t e9 = 1000000000;
  if (at == end) return false;
  std::uint64_t value = 0;
  if (end - at <= 18) {  // always fits 64 bits: two parts of at most nine digits
    std::uint32_t high = 0;
    std::uint32_t low = 0;
    const char* const last_nine = end - at > 9 ? end - 9 : at;
    if (last_nine != at && !parse_short(at, last_nine, high)) return false;
    if (!parse_short(last_nine, end, low)) return false;
    value = std::uint64_t{high} * e9 + low;
  } else {
    do {
      const unsigned digit = digit_value(*at);
      if (digit > 9 || value > (u64_max - digit) / 10) return false;
      value = value * 10 + digit;
    } while (++at != end);
  }
  if (value > limit) return false;
  out = value;
  return true;
}

bool skip_minus(Text text, const char*& at) {
  at = text.begin();
  if (text.empty() || *at != '-') return false;
  ++at;
  return true;
}

constexpr std::uint64_t magnitude_limit(bool negative) {
  return negative ? std::uint64_t{0x80000000U} : std::uint64_t{0x7FFFFFFFU};
}

constexpr std::int32_t with_sign(bool negative, std::uint64_t magnitude) {
  return static_cast<std::int32_t>(negative ? -static_cast<std::int64_t>(magnitude)
                                            : static_cast<std::int64_t>(magnitude));
}

constexpr std::uint32_t magnitude_of(std::int32_t value) {
  return value < 0 ? 0U - static_cast<std::uint32_t>(value) : static_cast<std::uint32_t>(value);
}

constexpr char digit_pairs[] =
    "0001020304050607080910111213141516171819202122232425262728293031323334353637383940414243444546"
    "4748495051525354555657585960616263646566676869707172737475767778798081828384858687888990919293"
    "949596979899";

inline void put_pair(char* out, std::uint32_t below_100) {
  std::memcpy(out, digit_pairs + 2 * below_100, 2);
}

// `value` must be at least 100.
int decimal_digits(std::uint32_t value) {
  if (value < 10000) return value < 1000 ? 3 : 4;
  if (value < 1000000) return value < 100000 ? 5 : 6;
  if (value < 100000000) return value < 10000000 ? 7 : 8;
  return value < 1000000000 ? 9 : 10;
}

char* put_8_digits(char* out, std::uint32_t value) {
  for (int i = 6; i >= 0; i -= 2) {
    put_pair(out + i, value % 100);
    value /= 100;
  }
  return out + 8;
}

// A table, because a processor cannot predict branches on the digits of a CRC.
struct HexDigits {
  static constexpr std::uint8_t none = 0x80;
  std::uint8_t of[256] = {};
  constexpr HexDigits() {
    for (int c = 0; c < 256; ++c) {
      const int letter = (c | 0x20) - 'a';
      of[c] = none;
      if (c >= '0' && c <= '9') of[c] = static_cast<std::uint8_t>(c - '0');
      if (letter >= 0 && letter < 6) of[c] = static_cast<std::uint8_t>(letter + 10);
    }
  }
};
constexpr HexDigits hex_digits;

}  // namespace

bool parse_number(Text text, std::uint32_t& out) {
  if (fits_32_bits(text.size())) return parse_short(text.begin(), text.end(), out);
  std::uint64_t value = 0;
  if (!parse_digits(text.begin(), text.end(), u32_max, value)) return false;
  out = static_cast<std::uint32_t>(value);
  return true;
}

bool parse_number(Text text, std::uint64_t& out) {
  if (fits_32_bits(text.size())) {
    std::uint32_t value = 0;
    if (!parse_short(text.begin(), text.end(), value)) return false;
    out = value;
    return true;
  }
  return parse_digits(text.begin(), text.end(), u64_max, out);
}

bool parse_number(Text text, std::int32_t& out) {
  const char* at = nullptr;
  const bool negative = skip_minus(text, at);
  if (fits_32_bits(static_cast<std::size_t>(text.end() - at))) {
    std::uint32_t value = 0;
    if (!parse_short(at, text.end(), value)) return false;
    out = negative ? -static_cast<std::int32_t>(value) : static_cast<std::int32_t>(value);
    return true;
  }
  std::uint64_t magnitude = 0;
  if (!parse_digits(at, text.end(), magnitude_limit(negative), magnitude)) return false;
  out = with_sign(negative, magnitude);
  return true;
}

bool is_whole_number(Text text) {
  const char* at = nullptr;
  skip_minus(text, at);
  if (at == text.end()) return false;
  for (; at != text.end(); ++at) {
    if (!is_decimal_digit(*at)) return false;
  }
  return true;
}

bool parse_hundredths(Text text, std::int32_t& out) {
  char terminated[41] = {};
  if (text.empty() || text.size() >= sizeof terminated) return false;
  std::memcpy(terminated, text.data(), text.size());
  const char* at = terminated;
  std::int32_t hundredths = 0;
  if (!take_hundredths(at, hundredths) || at != terminated + text.size()) return false;
  out = hundredths;
  return true;
}

bool parse_hex(Text text, std::uint32_t& out) {
  if (text.empty() || text.size() > 8) return false;
  std::uint32_t value = 0;
  std::uint32_t seen = 0;
  for (const char c : text) {
    const std::uint32_t digit = hex_digits.of[static_cast<unsigned char>(c)];
    seen |= digit;
    value = value << 4 | digit;
  }
  if ((seen & HexDigits::none) != 0) return false;
  out = value;
  return true;
}

bool parse_session_id(Text text, SessionId& out) {
  if (text.size() != session_id_size) return false;
  std::uint32_t halves[2] = {0, 0};
  std::uint32_t seen = 0;
  unsigned all = 0x20;  // set in '0' to '9' and 'a' to 'f', clear in 'A' to 'F'
  const char* at = text.begin();
  for (std::uint32_t& half : halves) {
    for (const char* const end = at + session_id_size / 2; at != end; at += 2) {
      const std::uint32_t high = hex_digits.of[static_cast<unsigned char>(at[0])];
      const std::uint32_t low = hex_digits.of[static_cast<unsigned char>(at[1])];
      seen |= high | low;
      all &= static_cast<unsigned>(at[0]) & static_cast<unsigned>(at[1]);
      half = half << 8 | high << 4 | low;
    }
  }
  out = SessionId{halves[0]} << 32 | halves[1];
  return (seen & HexDigits::none) == 0 && all != 0 && out != no_session;
}

char* write_session_id(char* out, SessionId sid) {
  for (int shift = 60; shift >= 0; shift -= 4) *out++ = "0123456789abcdef"[sid >> shift & 0xFU];
  return out;
}

char* write_number(char* out, std::uint32_t value) {
  if (value < 10) {
    *out = static_cast<char>('0' + value);
    return out + 1;
  }
  if (value < 100) {
    put_pair(out, value);
    return out + 2;
  }
  char* const end = out + decimal_digits(value);
  char* at = end;
  while (value >= 100) {
    at -= 2;
    put_pair(at, value % 100);
    value /= 100;
  }
  if (value >= 10) {
    put_pair(at - 2, value);
  } else {
    at[-1] = static_cast<char>('0' + value);
  }
  return end;
}

char* write_number(char* out, std::uint64_t value) {
  constexpr std::uint64_t e8 = 100000000;
  if (value <= u32_max) return write_number(out, static_cast<std::uint32_t>(value));
  out = write_number(out, value / e8);
  return put_8_digits(out, static_cast<std::uint32_t>(value % e8));
}

char* write_number(char* out, std::int32_t value) {
  if (value < 0) *out++ = '-';
  return write_number(out, magnitude_of(value));
}

char* write_hundredths(char* out, std::int32_t hundredths) {
  if (hundredths < 0) *out++ = '-';
  const std::uint32_t magnitude = magnitude_of(hundredths);
  out = write_number(out, magnitude / 100);
  *out = '.';
  put_pair(out + 1, magnitude % 100);
  return out + 3;
}

char* write_hex(char* out, std::uint32_t value) {
  int shift = 28;
  while (shift > 0 && value >> shift == 0) shift -= 4;
  for (; shift >= 0; shift -= 4) *out++ = "0123456789abcdef"[value >> shift & 0xFU];
  return out;
}

char* write_hex(char* out, const std::uint8_t* bytes, std::size_t size) {
  for (std::size_t i = 0; i < size; ++i) {
    *out++ = "0123456789abcdef"[bytes[i] >> 4];
    *out++ = "0123456789abcdef"[bytes[i] & 0xFU];
  }
  return out;
}

bool parse_hex(Text text, std::uint8_t* out, std::size_t size) {
  if (text.size() != 2 * size) return false;
  for (std::size_t i = 0; i < size; ++i) {
    std::uint32_t byte = 0;
    if (!parse_hex(text.substr(2 * i, 2), byte)) return false;
    out[i] = static_cast<std::uint8_t>(byte);
  }
  return true;
}

}  // namespace r4
