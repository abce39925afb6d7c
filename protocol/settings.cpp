// SPDX-License-Identifier: GPL-3.0-or-later
#include "settings.hpp"

#include "numbers.hpp"

namespace r4 {
namespace {

struct NumberSetting {
  Text key;
  std::uint32_t min;
  std::uint32_t max;
  std::uint16_t Settings::*member;
};

constexpr NumberSetting number_settings[] = {
    {"rate", 1, 1000, &Settings::state_rate_hz},
    {"heartbeat", 50, 1000, &Settings::heartbeat_ms},
    {"timeout", 100, 10000, &Settings::timeout_ms},
};

Refusal set_number(Settings& settings, const NumberSetting& setting, Text value) {
  std::uint32_t number = 0;
  if (!parse_number(value, number)) {
    return is_whole_number(value) ? Refusal::range : Refusal::format;
  }
  if (number < setting.min || number > setting.max) return Refusal::range;
  Settings changed = settings;
  changed.*setting.member = static_cast<std::uint16_t>(number);
  if (changed.heartbeat_ms >= changed.timeout_ms) return Refusal::range;
  settings = changed;
  return Refusal::none;
}

Refusal set_recovery(Settings& settings, Text value) {
  if (value == Text("last")) {
    settings.recovery = Recovery::last;
  } else if (value == Text("rearm")) {
    settings.recovery = Recovery::rearm;
  } else {
    return Refusal::format;
  }
  return Refusal::none;
}

Refusal set_pack(Settings& settings, Text value) {
  std::uint32_t number = 0;
  if (!parse_number(value, number)) {
    return is_whole_number(value) ? Refusal::range : Refusal::format;
  }
  if (number > 1) return Refusal::range;
  settings.pack = number == 1;
  return Refusal::none;
}

}  // namespace

Refusal set(Settings& settings, Text key, Text value) {
  for (const NumberSetting& setting : number_settings) {
    if (setting.key == key) return set_number(settings, setting, value);
  }
  if (key == Text("recovery")) return set_recovery(settings, value);
  if (key == Text("pack")) return set_pack(settings, value);
  return Refusal::unknown;
}

}  // namespace r4
