// SPDX-License-Identifier: GPL-3.0-or-later
#include "site_settings.hpp"

#include <cstring>

#include "../datagram/numbers.hpp"
#include "r4link/tables/state_fields.hpp"

namespace r4 {
namespace {

constexpr Text off_word("off");

enum class Site : int { network, password, host, port, node, chips, name, key, count };
constexpr int site_count = static_cast<int>(Site::count);
constexpr Text site_keys[site_count] = {"network", "password", "host", "port",
                                        "node",    "chips",    "name", key_setting};

struct Range {
  std::uint32_t min;
  std::uint32_t max;
};

Refusal read_number(Text value, Range range, std::uint32_t& out) {
  std::uint32_t number = 0;
  if (!parse_number(value, number)) {
    return is_whole_number(value) ? Refusal::range : Refusal::format;
  }
  if (number < range.min || number > range.max) return Refusal::range;
  out = number;
  return Refusal::none;
}

template <class Number>
Refusal set_number(Number& member, Text value, Range range) {
  std::uint32_t number = 0;
  const Refusal refusal = read_number(value, range, number);
  if (refusal == Refusal::none) member = static_cast<Number>(number);
  return refusal;
}

// Decodes %XX; `out` ends in NUL. Not for an empty text, nor a NUL within.
Refusal decode(Text value, char* out, std::size_t min, std::size_t max) {
  std::size_t size = 0;
  for (std::size_t i = 0; i < value.size(); ++i) {
    char c = value[i];
    if (c == '%') {
      std::uint32_t byte = 0;
      if (i + 2 >= value.size() || !parse_hex(value.substr(i + 1, 2), byte) || byte == 0) {
        return Refusal::format;
      }
      c = static_cast<char>(byte);
      i += 2;
    }
    if (size == max) return Refusal::range;
    out[size++] = c;
  }
  out[size] = '\0';
  return size < min ? Refusal::range : Refusal::none;
}

bool is_in_board_name(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
         c == '-';
}

bool is_plain(char c) {
  return c > ' ' && c <= '~' && c != ',' && c != ';' && c != '^' && c != '%';
}

// The text that decode() makes `bytes` of; `off` if there are none.
Text encode(const char* bytes, char* out) {
  if (bytes[0] == '\0') {
    std::memcpy(out, off_word.data(), off_word.size());
    return Text(out, off_word.size());
  }
  constexpr Text digits("0123456789abcdef");
  const bool reserved = Text(bytes, std::strlen(bytes)) == off_word;
  char* at = out;
  for (const char* byte = bytes; *byte != '\0'; ++byte) {
    if (is_plain(*byte) && !(reserved && byte == bytes)) {
      *at++ = *byte;
      continue;
    }
    const auto code = static_cast<unsigned char>(*byte);
    *at++ = '%';
    *at++ = digits[code >> 4];
    *at++ = digits[code & 0xFU];
  }
  return Text(out, static_cast<std::size_t>(at - out));
}

Refusal set_network(SiteSettings& settings, Text value) {
  char name[network_max + 1] = {};
  if (value != off_word) {
    const Refusal refusal = decode(value, name, 1, network_max);
    if (refusal != Refusal::none) return refusal;
  }
  if (std::strcmp(name, settings.network) == 0) return Refusal::none;
  std::memcpy(settings.network, name, sizeof name);
  std::memset(settings.password, 0, sizeof settings.password);
  return Refusal::none;
}

Refusal set_password(SiteSettings& settings, Text value) {
  char password[password_max + 1] = {};
  if (value != off_word) {
    const Refusal refusal = decode(value, password, password_min, password_max);
    if (refusal != Refusal::none) return refusal;
  }
  std::memcpy(settings.password, password, sizeof password);
  return Refusal::none;
}

Refusal set_host(SiteSettings& settings, Text value) {
  std::uint32_t address = 0;
  for (int part = 0; value != off_word && part < 4; ++part) {
    std::size_t size = 0;
    while (size < value.size() && value[size] != '.') ++size;
    if ((part < 3) != (size < value.size())) return Refusal::format;
    std::uint32_t byte = 0;
    const Refusal refusal = read_number(value.substr(0, size), Range{0, 255}, byte);
    if (refusal != Refusal::none) return refusal;
    address = address << 8 | byte;
    if (part < 3) value = value.substr(size + 1);
  }
  settings.host = address;
  return Refusal::none;
}

Refusal set_name(SiteSettings& settings, Text value) {
  if (value == off_word) value = Text();
  for (const char c : value) {
    if (!is_in_board_name(c)) return Refusal::format;
  }
  if (value.size() > board_name_max) return Refusal::range;
  std::memset(settings.name, 0, sizeof settings.name);
  if (!value.empty()) std::memcpy(settings.name, value.data(), value.size());
  return Refusal::none;
}

// `<id>:off`, or a key as parse_key() takes it.
Refusal set_key(Key (&keys)[max_keys], Text value) {
  Key key;
  Text rest;
  Refusal refusal = split_key(value, key.id, rest);
  if (refusal != Refusal::none) return refusal;
  const bool off = rest == off_word;
  if (!off) refusal = parse_key(value, key);
  if (refusal != Refusal::none) return refusal;
  int at = 0;
  while (at < max_keys && keys[at].id != 0 && keys[at].id != key.id) ++at;
  if (!off) {
    if (at == max_keys) return Refusal::range;
    keys[at] = key;
    return Refusal::none;
  }
  for (; at < max_keys; ++at) keys[at] = at + 1 < max_keys ? keys[at + 1] : Key();
  return Refusal::none;
}

// Which setting has that key; -1: none. The analog inputs follow those of `Site`.
int index_of(Text key) {
  for (int i = 0; i < site_count; ++i) {
    if (site_keys[i] == key) return i;
  }
  for (int i = 0; i < analog_channels; ++i) {
    if (name_of(state_field(FieldKind::analog, i + 1)) == key) return site_count + i;
  }
  return -1;
}

Refusal set_full_scale(std::uint16_t& full_scale_cv, Text value) {
  constexpr std::int32_t max_cv = 65000;
  std::int32_t cv = 0;
  if (!parse_hundredths(value, cv))
    return is_whole_number(value) ? Refusal::range : Refusal::format;
  if (cv < 1 || cv > max_cv) return Refusal::range;
  full_scale_cv = static_cast<std::uint16_t>(cv);
  return Refusal::none;
}

template <class Number>
Text write(char* out, Number value) {
  return Text(out, static_cast<std::size_t>(write_number(out, value) - out));
}

Text write_host(char* out, std::uint32_t address) {
  if (address == 0) return encode("", out);
  char* at = out;
  for (int shift = 24; shift >= 0; shift -= 8) {
    at = write_number(at, address >> shift & 0xFFU);
    if (shift != 0) *at++ = '.';
  }
  return Text(out, static_cast<std::size_t>(at - out));
}

}  // namespace

bool operator==(const SiteSettings& a, const SiteSettings& b) {
  for (int i = 0; i < analog_channels; ++i) {
    if (a.full_scale_cv[i] != b.full_scale_cv[i]) return false;
  }
  for (int i = 0; i < max_keys; ++i) {
    if (a.keys[i] != b.keys[i]) return false;
  }
  return std::strcmp(a.network, b.network) == 0 && std::strcmp(a.password, b.password) == 0 &&
         a.host == b.host && a.udp_port == b.udp_port && a.can_node == b.can_node &&
         a.chips == b.chips && std::strcmp(a.name, b.name) == 0;
}

bool is_board_name(Text text) {
  return is_board_id(text) && text.size() <= board_name_max && text != off_word;
}

bool is_board_id(Text text) {
  for (const char c : text) {
    if (!is_in_board_name(c)) return false;
  }
  return !text.empty() && text.size() <= board_id_max;
}

bool is_site_setting(Text key) { return index_of(key) >= 0; }

bool is_secret_setting(Text key) {
  const int index = index_of(key);
  return index == static_cast<int>(Site::password) || index == static_cast<int>(Site::key);
}

Refusal set(SiteSettings& settings, Text key, Text value) {
  const int index = index_of(key);
  if (index < 0) return Refusal::unknown;
  if (index >= site_count) return set_full_scale(settings.full_scale_cv[index - site_count], value);
  switch (static_cast<Site>(index)) {
    case Site::network:
      return set_network(settings, value);
    case Site::password:
      return set_password(settings, value);
    case Site::host:
      return set_host(settings, value);
    case Site::port:
      return set_number(settings.udp_port, value, Range{1, 65535});
    case Site::node:
      return set_number(settings.can_node, value, Range{0, 31});
    case Site::chips:
      return set_number(settings.chips, value, Range{0, 31});
    case Site::name:
      return set_name(settings, value);
    case Site::key:
      return set_key(settings.keys, value);
    case Site::count:
      break;
  }
  return Refusal::unknown;
}

bool get(const SiteSettings& settings, int index, Text& key, char (&out)[max_site_value],
         Text& value) {
  // The single ones, the analog inputs, the keys.
  constexpr int first_input = static_cast<int>(Site::key);
  constexpr int first_key = first_input + analog_channels;
  if (index < 0 || index >= first_key + max_keys) return false;
  if (index >= first_key) {
    const Key& one = settings.keys[index - first_key];
    key = site_keys[static_cast<int>(Site::key)];
    value = Text(out, static_cast<std::size_t>(write_key(out, one) - out));
    return one.id != 0;
  }
  if (index >= first_input) {
    const int input = index - first_input;
    key = name_of(state_field(FieldKind::analog, input + 1));
    char* const end = write_hundredths(out, std::int32_t{settings.full_scale_cv[input]});
    value = Text(out, static_cast<std::size_t>(end - out));
    return true;
  }
  key = site_keys[index];
  switch (static_cast<Site>(index)) {
    case Site::network:
      value = encode(settings.network, out);
      break;
    case Site::password:
      value = encode(settings.password, out);
      break;
    case Site::host:
      value = write_host(out, settings.host);
      break;
    case Site::port:
      value = write(out, std::uint32_t{settings.udp_port});
      break;
    case Site::node:
      value = write(out, std::uint32_t{settings.can_node});
      break;
    case Site::name:
      value = encode(settings.name, out);
      break;
    case Site::chips:
    case Site::key:
    case Site::count:
      value = write(out, std::uint32_t{settings.chips});
      break;
  }
  return true;
}

}  // namespace r4
