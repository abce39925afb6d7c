// SPDX-License-Identifier: GPL-3.0-or-later
// The settings of one board at its site (r4link/tables/settings.hpp; docs/reference/protocol.md,
// section 3). Only a host on the board's own cable may change them (Port::may_configure()). In a
// name or password, bytes outside the grammar are written as in URLs: %2C is a comma, %25 is a
// percent sign, and %6Fff is a network named "off". Node and wiring take effect at the next start,
// all other settings at once.
#pragma once

#include <cstddef>
#include <cstdint>

#include "r4link/key.hpp"
#include "r4link/state.hpp"
#include "r4link/tables/settings.hpp"
#include "r4link/text.hpp"
#include "r4link/vocabulary.hpp"
#include "r4link/wiring/wiring_value.hpp"

namespace r4 {

constexpr std::size_t network_max = row_of(Setting::network).max;
constexpr std::size_t password_max = row_of(Setting::password).max;
constexpr std::size_t board_name_max = row_of(Setting::name).max;
constexpr std::uint16_t standard_full_scale_cv = row_of(Setting::full_scale).standard;

struct SiteSettings {
  char network[network_max + 1] = {};  // ends in NUL; empty: off
  char password[password_max + 1] = {};
  std::uint32_t host = 0;  // a.b.c.d, a in the highest byte; 0: off
  std::uint16_t udp_port = row_of(Setting::port).standard;
  std::uint8_t can_node = row_of(Setting::node).standard;
  char name[board_name_max + 1] = {};  // ends in NUL; empty: off
  Wiring wiring = plan_wiring();
  WiringSource wiring_source = WiringSource::plan;
  std::uint16_t full_scale_cv[analog_channels] = {standard_full_scale_cv, standard_full_scale_cv,
                                                  standard_full_scale_cv, standard_full_scale_cv,
                                                  standard_full_scale_cv, standard_full_scale_cv};
  Key keys[max_keys];  // used entries come first

  // The stored wiring cannot be read.
  void lose_wiring() {
    wiring = Wiring();
    wiring_source = WiringSource::damaged;
  }
};
bool operator==(const SiteSettings& a, const SiteSettings& b);

// True for 1 to 31 letters, digits, _ and -; not for "off".
bool is_board_name(Text text);
// The board's own id: 1 to 64 of the same characters.
constexpr std::size_t board_id_max = 64;
bool is_board_id(Text text);

bool is_site_setting(Text key);
bool is_secret_setting(Text key);

// `number`: which key of a setting with several keys, from 1. `row` is null for an unknown key.
struct FoundSetting {
  const SettingRow* row;
  int number;
};
FoundSetting find_setting(Text key);

Refusal read_number(Text value, std::uint32_t min, std::uint32_t max, std::uint32_t& out);
template <class Number>
Refusal set_number(Number& member, const SettingRow& row, Text value) {
  std::uint32_t number = 0;
  const Refusal refusal = read_number(value, row.min, row.max, number);
  if (refusal == Refusal::none) member = static_cast<Number>(number);
  return refusal;
}

// Like set() in settings.hpp. Refusal::unknown for a setting that is not of the site.
Refusal set(SiteSettings& settings, FoundSetting found, Text value);

// The longest value: a wiring, or each byte of a password as %XX.
constexpr std::size_t max_site_value =
    max_wiring_value > 3 * password_max ? max_wiring_value : 3 * password_max;
// Gets the key of setting `index`, from 0, and its value as set() takes it. False if there is no
// such setting. Values include secrets: use get() only for storage.
bool get(const SiteSettings& settings, int index, Text& key, char (&out)[max_site_value],
         Text& value);

}  // namespace r4
