// SPDX-License-Identifier: GPL-3.0-or-later
#include "settings.hpp"

#include <cstring>

#include "../datagram/numbers.hpp"
#include "../datagram/same_elements.hpp"

namespace r4 {
namespace {

struct NumberSetting {
  Text key;
  std::uint32_t min;
  std::uint32_t max;
  std::uint16_t Settings::*member;
};

constexpr NumberSetting number_settings[] = {
    {"rate", 1, state_rate_max_hz, &Settings::state_rate_hz},
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

// The first `c` in `text`; its size if there is none.
std::size_t position(Text text, char c) {
  std::size_t at = 0;
  while (at < text.size() && text[at] != c) ++at;
  return at;
}

// Lines "key,value" one after the other.
class Lines {
 public:
  Lines(char* out, std::size_t capacity) : out_(out), capacity_(capacity) {}
  void add(Text key, Text value) {
    append(key);
    append(",");
    append(value);
    append("\n");
  }
  bool ok() const { return ok_; }
  Text text() const { return Text(out_, size_); }

 private:
  void append(Text text) {
    ok_ = ok_ && text.size() <= capacity_ - size_;
    if (!ok_) return;
    std::memcpy(out_ + size_, text.data(), text.size());
    size_ += text.size();
  }
  char* const out_;
  const std::size_t capacity_;
  std::size_t size_ = 0;
  bool ok_ = true;
};

// The digit from 1 to `most` behind a prefix; 0: it is another key.
int number_behind(Text prefix, int most, Text key) {
  if (key.size() != prefix.size() + 1 || key.substr(0, prefix.size()) != prefix) return 0;
  const int number = key[prefix.size()] - '0';
  return number >= 1 && number <= most ? number : 0;
}

}  // namespace

int poll_slot_of(Text key) { return number_behind("i2c", i2c_slots, key); }
int uart_of(Text key) { return number_behind("uart", uart_channels, key); }

Refusal set(Settings& settings, Text key, Text value) {
  for (const NumberSetting& setting : number_settings) {
    if (setting.key == key) return set_number(settings, setting, value);
  }
  if (key == Text("recovery")) return set_recovery(settings, value);
  if (key == Text("pack")) return set_pack(settings, value);
  if (const int slot = poll_slot_of(key)) return parse_poll(value, settings.polls[slot - 1]);
  if (const int uart = uart_of(key)) return parse_uart_mode(value, settings.uarts[uart - 1]);
  return set(settings.site, key, value);
}

bool operator==(const Settings& a, const Settings& b) {
  return a.state_rate_hz == b.state_rate_hz && a.heartbeat_ms == b.heartbeat_ms &&
         a.timeout_ms == b.timeout_ms && a.recovery == b.recovery && a.pack == b.pack &&
         same_elements(a.polls, b.polls) && same_elements(a.uarts, b.uarts) && a.site == b.site;
}

bool write_settings(const Settings& settings, char* out, std::size_t capacity, Text& text) {
  Lines lines(out, capacity);
  for (const NumberSetting& setting : number_settings) {
    char digits[max_number_text];
    const char* const end = write_number(digits, std::uint32_t{settings.*setting.member});
    lines.add(setting.key, Text(digits, static_cast<std::size_t>(end - digits)));
  }
  lines.add("recovery", settings.recovery == Recovery::last ? Text("last") : Text("rearm"));
  lines.add("pack", settings.pack ? Text("1") : Text("0"));
  char key_text[] = "i2c1";
  char poll[max_poll_text];
  for (int i = 0; i < i2c_slots; ++i) {
    key_text[3] = static_cast<char>('1' + i);
    if (settings.polls[i].on()) lines.add(Text(key_text, 4), write_poll(settings.polls[i], poll));
  }
  char uart_key[] = "uart1";
  char mode[max_uart_text];
  for (int i = 0; i < uart_channels; ++i) {
    uart_key[4] = static_cast<char>('1' + i);
    if (settings.uarts[i].on())
      lines.add(Text(uart_key, 5), write_uart_mode(settings.uarts[i], mode));
  }
  char buffer[max_site_value];
  Text key;
  Text value;
  for (int i = 0; get(settings.site, i, key, buffer, value); ++i) lines.add(key, value);
  text = lines.text();
  return lines.ok();
}

void read_settings(Text text, Settings& settings) {
  // Twice: a heartbeat may have to wait for a longer timeout.
  for (int round = 0; round < 2; ++round) {
    for (Text rest = text; !rest.empty();) {
      const std::size_t line = position(rest, '\n');
      const std::size_t comma = position(rest, ',');
      if (comma < line) {
        set(settings, rest.substr(0, comma), rest.substr(comma + 1, line - comma - 1));
      }
      rest = line == rest.size() ? Text() : rest.substr(line + 1);
    }
  }
}

}  // namespace r4
