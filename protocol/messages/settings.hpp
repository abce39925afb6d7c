// SPDX-License-Identifier: GPL-3.0-or-later
// The board's settings, whose keys, ranges and defaults are in r4link/tables/settings.hpp (paper
// section 8.1: 100 Hz state, 2 Hz heartbeat, 1 s timeout). The heartbeat interval is below the timeout.
// 1000/rate is rounded down to whole milliseconds. Beside them those of the place where the board stands:
// site_settings.hpp.
#pragma once

#include <cstddef>
#include <cstdint>

#include "device_command.hpp"
#include "r4link/text.hpp"
#include "r4link/vocabulary.hpp"
#include "site_settings.hpp"

namespace r4 {

enum class Recovery : std::uint8_t { last, rearm };

struct Settings {
  std::uint16_t state_rate_hz = row_of(Setting::rate).standard;
  std::uint16_t heartbeat_ms = row_of(Setting::heartbeat).standard;
  std::uint16_t timeout_ms = row_of(Setting::timeout).standard;
  Recovery recovery = Recovery::last;
  bool pack = row_of(Setting::pack).standard != 0;
  I2cPoll polls[i2c_slots];  // that are there when a session begins
  UartMode uarts[uart_channels];
  SiteSettings site;

  std::uint32_t state_period_ms() const { return 1000U / state_rate_hz; }
};
bool operator==(const Settings& a, const Settings& b);
inline bool operator!=(const Settings& a, const Settings& b) { return !(a == b); }

// Changes one setting. Refusal::unknown for a key, ::format for a value that is not of the key's
// kind, ::range outside its range; `settings` only changes on Refusal::none.
Refusal set(Settings& settings, Text key, Text value);

// All settings as lines "key,value", each ended by a line feed, so that they can be kept. False:
// more than `capacity` bytes.
constexpr std::size_t max_settings_text = 1200;
bool write_settings(const Settings& settings, char* out, std::size_t capacity, Text& text);
// Takes such lines, in any order. What is not known or not allowed is passed over: the text may be
// of an older or newer firmware.
void read_settings(Text text, Settings& settings);

// --- what is secret

// The part of a command's text ("C:password,letmein!", "C:key,1:5a…") that is for the board alone:
// the digits of a key, and the password of the network. Empty if there is none. The value of a
// setting that is not known is taken for a secret, because its name may be misspelled.
Text secret_in(Text command);

}  // namespace r4
