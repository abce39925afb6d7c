// SPDX-License-Identifier: GPL-3.0-or-later
// The board's settings (paper section 8.1: 100 Hz state, 2 Hz heartbeat, 1 s timeout). Keys, ranges
// and defaults: r4link/tables/settings.hpp. The heartbeat interval is less than the timeout.
// 1000/rate is rounded down to whole ms. Settings of the board's site: site_settings.hpp.
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
  I2cPoll polls[i2c_slots];  // the readings that start when a session begins
  UartMode uarts[uart_channels];
  SiteSettings site;

  std::uint32_t state_period_ms() const { return 1000U / state_rate_hz; }
};
bool operator==(const Settings& a, const Settings& b);
inline bool operator!=(const Settings& a, const Settings& b) { return !(a == b); }

// Refusal::unknown (key), ::format or ::range. `settings` changes only on Refusal::none.
Refusal set(Settings& settings, Text key, Text value);

// Lines "key,value", each ended by a line feed, for storage. False if `capacity` is too small.
constexpr std::size_t max_settings_text = 1440;
bool write_settings(const Settings& settings, char* out, std::size_t capacity, Text& text);
// Reads lines of this form, in any order. Skips unknown and invalid lines, because the text may be
// from another firmware. A missing or invalid wiring counts as damaged: the board must not guess.
void read_settings(Text text, Settings& settings);

// The secret part of a command's text ("C:password,letmein!", "C:key,1:5a…"); empty if the text has
// no secret. The value of an unknown setting counts as secret, because its name may be misspelled.
Text secret_in(Text command);

}  // namespace r4
