// SPDX-License-Identifier: GPL-3.0-or-later
#include "grammar.hpp"

#include <cstdint>

namespace r4 {
namespace {

constexpr std::uint8_t in_name = 1;
constexpr std::uint8_t in_value = 2;
constexpr std::uint8_t in_values = 4;

struct ByteClasses {
  std::uint8_t of[256] = {};
  constexpr ByteClasses() {
    for (int c = 0x20; c <= 0x7E; ++c) {
      if (c == ';' || c == '^') continue;
      of[c] = in_values;
      if (c == ',') continue;
      of[c] |= in_value;
      if (c != ' ' && c != ':') of[c] |= in_name;
    }
  }
};

constexpr ByteClasses classes;

template <std::uint8_t allowed>
const char* skip(const char* at, const char* end) {
  while (at != end && (classes.of[static_cast<unsigned char>(*at)] & allowed) != 0) ++at;
  return at;
}

}  // namespace

const char* skip_name(const char* at, const char* end) { return skip<in_name>(at, end); }
const char* skip_value(const char* at, const char* end) { return skip<in_value>(at, end); }
const char* skip_values(const char* at, const char* end) { return skip<in_values>(at, end); }

}  // namespace r4
