// SPDX-License-Identifier: GPL-3.0-or-later
// The settings of one board where it stands: how it is wired and reached. Their keys, ranges and defaults are
// in r4link/tables/settings.hpp, what they mean in docs/protocol.md, section 3. They are taken only from
// a host on a cable of the board's own (Port::may_configure()).
//
// In a name or password, what the grammar does not allow is written as in URLs: %2C is a comma, %25
// a percent sign, %6Fff the network that is called "off".
//
// network, password, host, port, name, key and analog inputs count at once, the others when the board
// starts next.
#pragma once

#include <cstddef>
#include <cstdint>

#include "r4link/key.hpp"
#include "r4link/state.hpp"
#include "r4link/tables/settings.hpp"
#include "r4link/text.hpp"
#include "r4link/vocabulary.hpp"

namespace r4 {

constexpr std::size_t network_max = row_of(Setting::network).max;
constexpr std::size_t password_max = row_of(Setting::password).max;
constexpr std::size_t board_name_max = row_of(Setting::name).max;
constexpr std::uint16_t standard_full_scale_cv = row_of(Setting::full_scale).standard;

struct SiteSettings {
  char network[network_max + 1] = {};    // ends in NUL; empty: off
  char password[password_max + 1] = {};  // likewise
  std::uint32_t host = 0;                // a.b.c.d, a in the highest byte; 0: off
  std::uint16_t udp_port = row_of(Setting::port).standard;
  std::uint8_t can_node = row_of(Setting::node).standard;
  std::uint8_t chips = row_of(Setting::chips).standard;
  char name[board_name_max + 1] = {};  // ends in NUL; empty: off
  std::uint16_t full_scale_cv[analog_channels] = {standard_full_scale_cv, standard_full_scale_cv,
                                                  standard_full_scale_cv, standard_full_scale_cv,
                                                  standard_full_scale_cv, standard_full_scale_cv};
  Key keys[max_keys];  // those there are come first
};
bool operator==(const SiteSettings& a, const SiteSettings& b);

// True if the owner of a board may call it so: 1 to 31 letters, digits, _ and -.
bool is_board_name(Text text);
// The same of the id that it has of itself: 1 to 64 of them.
constexpr std::size_t board_id_max = 64;
bool is_board_id(Text text);

bool is_site_setting(Text key);
// True for `password` and `key`, whose values are for the board alone.
bool is_secret_setting(Text key);

// The setting of a key. Where there are several: which of them, from 1. No row: there is no such setting.
struct FoundSetting {
  const SettingRow* row;
  int number;
};
FoundSetting find_setting(Text key);

// Reads a number, which has to be in its range.
Refusal read_number(Text value, std::uint32_t min, std::uint32_t max, std::uint32_t& out);
template <class Number>
Refusal set_number(Number& member, const SettingRow& row, Text value) {
  std::uint32_t number = 0;
  const Refusal refusal = read_number(value, row.min, row.max, number);
  if (refusal == Refusal::none) member = static_cast<Number>(number);
  return refusal;
}

// As set() of settings.hpp. Refusal::unknown for a setting that is not the site's.
Refusal set(SiteSettings& settings, FoundSetting found, Text value);

// The longest text of a value: each byte of a password as %XX.
constexpr std::size_t max_site_value = 3 * password_max;
// The value of setting `index` (0 …) as set() takes it, in `out`; its key in `key`. False: there is
// no such setting. For keeping them, not for telling: the secret ones are among them.
bool get(const SiteSettings& settings, int index, Text& key, char (&out)[max_site_value],
         Text& value);

}  // namespace r4
