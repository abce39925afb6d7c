// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/wiring/wiring_value.hpp"

#include <cstring>
#include <initializer_list>

#include "../datagram/crc32.hpp"
#include "../datagram/numbers.hpp"

namespace r4 {
namespace {

constexpr Text version("1:");
constexpr std::size_t digits = 2 * signal_count;
constexpr std::size_t checked = 2 + digits;

}  // namespace

Text write_wiring_value(const Wiring& wiring, char (&out)[max_wiring_value]) {
  std::uint8_t bytes[signal_count];
  for (int i = 0; i < signal_count; ++i) bytes[i] = wiring.places[i].byte;
  std::memcpy(out, version.data(), version.size());
  char* at = write_hex(out + version.size(), bytes, sizeof bytes);
  *at++ = ':';
  at = write_hex(at, crc32(Text(out, checked)));
  return Text(out, static_cast<std::size_t>(at - out));
}

Refusal read_wiring_value(Text value, Wiring& wiring) {
  if (value.size() <= checked || value.substr(0, version.size()) != version ||
      value[checked] != ':') {
    return Refusal::format;
  }
  std::uint8_t bytes[signal_count];
  std::uint32_t crc = 0;
  if (!parse_hex(value.substr(version.size(), digits), bytes, sizeof bytes) ||
      !parse_hex(value.substr(checked + 1), crc) || crc != crc32(value.substr(0, checked))) {
    return Refusal::format;
  }
  Wiring read;
  for (int i = 0; i < signal_count; ++i) read.places[i].byte = bytes[i];
  if (check(read).fault != WiringFault::none) return Refusal::range;
  wiring = read;
  return Refusal::none;
}

std::uint32_t crc_of(const Wiring& wiring) {
  char bytes[signal_count];
  for (int i = 0; i < signal_count; ++i) bytes[i] = static_cast<char>(wiring.places[i].byte);
  return crc32(Text(bytes, sizeof bytes));
}

Text write_board_wiring(const BoardWiring& kept, char (&out)[max_board_wiring]) {
  const char* const source = to_text(kept.source);
  const std::size_t size = std::strlen(source);
  std::memcpy(out, source, size);
  char* at = out + size;
  *at++ = ',';
  *at++ = kept.in_use ? '1' : '0';
  *at++ = ',';
  char value[max_wiring_value];
  const Text text = write_wiring_value(kept.wiring, value);
  std::memcpy(at, text.data(), text.size());
  return Text(out, static_cast<std::size_t>(at - out) + text.size());
}

bool read_board_wiring(Text text, BoardWiring& kept) {
  for (const WiringSource source :
       {WiringSource::plan, WiringSource::given, WiringSource::damaged}) {
    const char* const word = to_text(source);
    const std::size_t size = std::strlen(word);
    if (text.size() < size + 3 || text.substr(0, size) != Text(word, size)) continue;
    const char in_use = text[size + 1];
    if (text[size] != ',' || text[size + 2] != ',' || (in_use != '0' && in_use != '1'))
      return false;
    if (read_wiring_value(text.substr(size + 3), kept.wiring) != Refusal::none) return false;
    kept.source = source;
    kept.in_use = in_use == '1';
    return true;
  }
  return false;
}

}  // namespace r4
