// SPDX-License-Identifier: GPL-3.0-or-later
#include "site_settings.hpp"

#include <cstring>

#include "../datagram/numbers.hpp"
#include "r4link/tables/state_fields.hpp"

namespace r4 {
namespace {

constexpr Text off_word("off");

// Decodes %XX; `out` ends in NUL. Refuses an empty text and a text with a NUL.
Refusal decode(const SettingRow& row, Text value, char* out) {
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
    if (size == row.max) return Refusal::range;
    out[size++] = c;
  }
  out[size] = '\0';
  return size < row.min ? Refusal::range : Refusal::none;
}

bool is_in_board_name(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
         c == '-';
}

bool is_plain(char c) {
  return c > ' ' && c <= '~' && c != ',' && c != ';' && c != '^' && c != '%';
}

// The inverse of decode(); `off` if `bytes` is empty.
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
    const Refusal refusal = decode(row_of(Setting::network), value, name);
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
    const Refusal refusal = decode(row_of(Setting::password), value, password);
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
    const Refusal refusal = read_number(value.substr(0, size), 0, 255, byte);
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

// `value`: `<id>:off`, or a key as in parse_key().
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

Refusal set_wiring(SiteSettings& settings, Text value) {
  if (value == off_word) {
    settings.wiring = plan_wiring();
    settings.wiring_source = WiringSource::plan;
    return Refusal::none;
  }
  const Refusal refusal = read_wiring_value(value, settings.wiring);
  if (refusal == Refusal::none) settings.wiring_source = WiringSource::given;
  return refusal;
}

// A damaged wiring stays damaged until a valid wiring is set.
Text write_wiring(const SiteSettings& settings, char (&out)[max_wiring_value]) {
  if (settings.wiring_source == WiringSource::given)
    return write_wiring_value(settings.wiring, out);
  return settings.wiring_source == WiringSource::plan ? off_word : Text("damaged");
}

bool has_key(const SettingRow& row, int number, Text key) {
  if (row.setting == Setting::full_scale)
    return name_of(state_field(FieldKind::analog, number)) == key;
  if (row.keys == 1) return row.key == key;
  const std::size_t digit = row.key.size() - 1;
  return key.size() == row.key.size() && key.substr(0, digit) == row.key.substr(0, digit) &&
         key[digit] == '0' + number;
}

Refusal set_full_scale(std::uint16_t& full_scale_cv, Text value) {
  constexpr SettingRow row = row_of(Setting::full_scale);
  std::int32_t cv = 0;
  if (!parse_hundredths(value, cv))
    return is_whole_number(value) ? Refusal::range : Refusal::format;
  if (cv < std::int32_t{row.min} || cv > std::int32_t{row.max}) return Refusal::range;
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
         std::strcmp(a.name, b.name) == 0 && a.wiring_source == b.wiring_source &&
         a.wiring == b.wiring;
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

FoundSetting find_setting(Text key) {
  for (const SettingRow& row : setting_rows) {
    for (int number = 1; number <= row.keys; ++number) {
      if (has_key(row, number, key)) return {&row, number};
    }
  }
  return {nullptr, 0};
}

bool is_site_setting(Text key) {
  const SettingRow* const row = find_setting(key).row;
  return row != nullptr && row->setting >= Setting::network;
}

bool is_secret_setting(Text key) {
  return key == row_of(Setting::password).key || key == row_of(Setting::key).key;
}

Refusal read_number(Text value, std::uint32_t min, std::uint32_t max, std::uint32_t& out) {
  std::uint32_t number = 0;
  if (!parse_number(value, number)) {
    return is_whole_number(value) ? Refusal::range : Refusal::format;
  }
  if (number < min || number > max) return Refusal::range;
  out = number;
  return Refusal::none;
}

Refusal set(SiteSettings& settings, FoundSetting found, Text value) {
  const SettingRow& row = *found.row;
  switch (row.setting) {
    case Setting::network:
      return set_network(settings, value);
    case Setting::password:
      return set_password(settings, value);
    case Setting::host:
      return set_host(settings, value);
    case Setting::port:
      return set_number(settings.udp_port, row, value);
    case Setting::node:
      return set_number(settings.can_node, row, value);
    case Setting::name:
      return set_name(settings, value);
    case Setting::wiring:
      return set_wiring(settings, value);
    case Setting::full_scale:
      return set_full_scale(settings.full_scale_cv[found.number - 1], value);
    case Setting::key:
      return set_key(settings.keys, value);
    default:
      return Refusal::unknown;
  }
}

bool get(const SiteSettings& settings, int index, Text& key, char (&out)[max_site_value],
         Text& value) {
  constexpr int single = static_cast<int>(Setting::network);
  constexpr int first_input = static_cast<int>(Setting::full_scale) - single;
  constexpr int first_key = first_input + analog_channels;
  if (index < 0 || index >= first_key + max_keys) return false;
  if (index >= first_key) {
    const Key& one = settings.keys[index - first_key];
    key = row_of(Setting::key).key;
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
  const SettingRow& row = setting_rows[single + index];
  key = row.key;
  switch (row.setting) {
    case Setting::network:
      value = encode(settings.network, out);
      break;
    case Setting::password:
      value = encode(settings.password, out);
      break;
    case Setting::host:
      value = write_host(out, settings.host);
      break;
    case Setting::port:
      value = write(out, std::uint32_t{settings.udp_port});
      break;
    case Setting::node:
      value = write(out, std::uint32_t{settings.can_node});
      break;
    case Setting::name:
      value = encode(settings.name, out);
      break;
    default:
      value = write_wiring(settings, out);
      break;
  }
  return true;
}

}  // namespace r4
