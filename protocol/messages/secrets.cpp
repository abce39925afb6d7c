// SPDX-License-Identifier: GPL-3.0-or-later
#include <cstring>

#include "../datagram/crc32.hpp"
#include "../datagram/numbers.hpp"
#include "r4link/datagram.hpp"
#include "r4link/messages/message.hpp"
#include "settings.hpp"

namespace r4 {
namespace {

constexpr Text setting_start("C:");
constexpr Text off_word("off");
constexpr Text mask("...");

Text between(const char* from, const char* to) {
  return Text(from, static_cast<std::size_t>(to - from));
}

const char* find_any(Text bytes, const char* at, const char* end) {
  for (; at != end; ++at) {
    for (const char each : bytes) {
      if (*at == each) return at;
    }
  }
  return end;
}

const char* next_setting(const char* at, const char* end) {
  while (end - at >= 2) {
    const void* const found =
        std::memchr(at, setting_start[0], static_cast<std::size_t>(end - at - 1));
    if (found == nullptr) return end;
    at = static_cast<const char*>(found);
    if (at[1] == setting_start[1]) return at;
    ++at;
  }
  return end;
}

char* append(char* out, Text text) {
  std::memcpy(out, text.data(), text.size());
  return out + text.size();
}

}  // namespace

Text secret_in(Text command) {
  if (command.size() < 2 || command.substr(0, 2) != setting_start) return Text();
  const char* const name_begin = command.begin() + 2;
  // Without a comma, the name ends at the next possible separator.
  const char* const name_end = find_any(Text(", :="), name_begin, command.end());
  if (name_end == command.end()) return Text();
  const Text name = between(name_begin, name_end);
  const Text value = between(name_end + 1, command.end());
  if (name == row_of(Setting::key).key) {
    // The id of a key and its removal are not secret.
    std::uint8_t id = 0;
    Text digits;
    if (split_key(value, id, digits) != Refusal::none) return value;
    return digits == off_word ? Text() : digits;
  }
  Settings settings;
  const bool is_known = set(settings, name, value) != Refusal::unknown;
  return is_known && !is_secret_setting(name) ? Text() : value;
}

Text without_secrets(Text bytes, char* room) {
  const char* at = next_setting(bytes.begin(), bytes.end());
  if (at == bytes.end()) return bytes;
  Datagram datagram;
  const bool valid = static_cast<bool>(read_datagram(bytes, datagram));
  const char* copied = bytes.begin();
  char* out = room;
  for (; at != bytes.end(); at = next_setting(at + 2, bytes.end())) {
    const bool is_field = at == bytes.begin() || at[-1] == ';';
    if (valid && !is_field) continue;
    const Text secret = secret_in(between(at, find_any(Text(";^"), at, bytes.end())));
    if (secret.empty()) continue;
    out = append(out, between(copied, secret.begin()));
    out = append(out, secret.size() < mask.size() ? mask.substr(0, secret.size()) : mask);
    copied = secret.end();
    if (!valid) return between(room, out);
  }
  if (copied == bytes.begin()) return bytes;
  out = append(out, between(copied, find_any(Text("^"), copied, bytes.end()) + 1));
  const std::uint32_t crc = crc32(between(room, out));
  out = append(out, Text("0x"));
  out = write_hex(out, crc);
  *out++ = '^';
  return between(room, out);
}

}  // namespace r4
