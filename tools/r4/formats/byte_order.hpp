// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace r4::tool {

enum class ByteOrder : std::uint8_t { little, big };

// Reads the number at the front of `bytes`, which must hold at least sizeof(Number).
template <class Number>
Number read_number(std::string_view bytes, ByteOrder order = ByteOrder::little) {
  std::uint64_t number = 0;
  for (std::size_t i = 0; i < sizeof(Number); ++i) {
    const std::size_t at = order == ByteOrder::big ? i : sizeof(Number) - 1 - i;
    number = number << 8 | static_cast<unsigned char>(bytes[at]);
  }
  return static_cast<Number>(number);
}

template <class Number>
void append_number(std::string& out, Number number, ByteOrder order = ByteOrder::little) {
  const auto bits = static_cast<std::uint64_t>(number);
  for (std::size_t i = 0; i < sizeof(Number); ++i) {
    const std::size_t at = order == ByteOrder::little ? i : sizeof(Number) - 1 - i;
    out += static_cast<char>(bits >> (8 * at) & 0xFF);
  }
}

}  // namespace r4::tool
