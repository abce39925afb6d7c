// SPDX-License-Identifier: GPL-3.0-or-later
// The settings of a board (`C:key,value`; docs/protocol.md, section 3): keys, ranges, defaults.
#pragma once

#include <cstddef>
#include <cstdint>

#include "../key.hpp"
#include "../state.hpp"
#include "../text.hpp"
#include "../vocabulary.hpp"

namespace r4 {

// In the order of `setting_rows`. From `network` on: of the place where the board stands. Those are
// taken only from a host on a cable of the board's own, because whoever sets them takes the board over.
enum class Setting : std::uint8_t {
  rate,
  heartbeat,
  timeout,
  recovery,
  pack,
  i2c,
  uart,
  network,
  password,
  host,
  port,
  node,
  chips,
  name,
  full_scale,
  key,
};
constexpr std::size_t setting_kinds = static_cast<std::size_t>(Setting::key) + 1;

struct SettingRow {
  Text key;  // where there are several: that of the first
  Setting setting;
  std::uint8_t keys;  // how many there are
  // Of a number in a value; of a text, how many bytes. Both 0: a word.
  std::uint32_t min;
  std::uint32_t max;
  std::uint32_t standard;  // the default of a number; of another setting, `off` or its first word
};

constexpr SettingRow setting_rows[] = {
    {"rate", Setting::rate, 1, 1, state_rate_max_hz, 100},
    {"heartbeat", Setting::heartbeat, 1, 50, 1000, 500},
    {"timeout", Setting::timeout, 1, 100, 10000, 1000},
    {"recovery", Setting::recovery, 1, 0, 0, 0},
    {"pack", Setting::pack, 1, 0, 1, 1},
    {"i2c1", Setting::i2c, i2c_slots, 0, 0, 0},
    {"uart1", Setting::uart, uart_channels, uart_min_baud, uart_max_baud, 0},
    {"network", Setting::network, 1, 1, 32, 0},
    {"password", Setting::password, 1, 8, 63, 0},
    {"host", Setting::host, 1, 0, 0, 0},
    {"port", Setting::port, 1, 1, 65535, 2018},
    {"node", Setting::node, 1, 0, 31, 1},
    {"chips", Setting::chips, 1, 0, 31, 31},
    {"name", Setting::name, 1, 1, 31, 0},
    {"AIN24", Setting::full_scale, analog_channels, 1, 65000, 5000},  // hundredths of a volt
    {"key", Setting::key, 1, 1, max_key_id, 0},
};
constexpr const SettingRow& row_of(Setting setting) {
  return setting_rows[static_cast<std::size_t>(setting)];
}

constexpr bool has_a_row_of_each_setting() {
  for (std::size_t i = 0; i < setting_kinds; ++i) {
    if (static_cast<std::size_t>(setting_rows[i].setting) != i) return false;
  }
  return sizeof setting_rows / sizeof *setting_rows == setting_kinds;
}
static_assert(has_a_row_of_each_setting(), "the rows stand in the order of their enum");

}  // namespace r4
