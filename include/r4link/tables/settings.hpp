// SPDX-License-Identifier: GPL-3.0-or-later
// The settings of a board (`C:key,value`; docs/reference/protocol.md, section 3).
#pragma once

#include <cstddef>
#include <cstdint>

#include "../key.hpp"
#include "../state.hpp"
#include "../text.hpp"
#include "../vocabulary.hpp"

namespace r4 {

// From `network` on: settings that a board accepts only over its own cable.
enum class Setting : std::uint8_t {
#define R4_SETTING(setting, ...) setting,
#include "board.def"
};

struct SettingRow {
  Text key;  // the first key, if the setting has more than one
  Setting setting;
  std::uint8_t keys;  // number of keys
  // Range of a number, or of a text's size in bytes. Both 0: a word.
  std::uint32_t min;
  std::uint32_t max;
  std::uint32_t standard;  // the default of a number; other settings: `off` or the first word
};

constexpr SettingRow setting_rows[] = {
#define R4_SETTING(setting, key, keys, min, max, standard, ...) \
  {key, Setting::setting, keys, min, max, standard},
#include "board.def"
};
constexpr const SettingRow& row_of(Setting setting) {
  return setting_rows[static_cast<std::size_t>(setting)];
}

}  // namespace r4
