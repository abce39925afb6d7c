// SPDX-License-Identifier: GPL-3.0-or-later
#include "settings.hpp"

#include <cstring>

#include "../datagram/numbers.hpp"
#include "../datagram/same_elements.hpp"

namespace r4 {
namespace {

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

std::size_t position(Text text, char c) {
  std::size_t at = 0;
  while (at < text.size() && text[at] != c) ++at;
  return at;
}

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

}  // namespace

Refusal set(Settings& settings, Text key, Text value) {
  const FoundSetting found = find_setting(key);
  if (found.row == nullptr) return Refusal::unknown;
  const SettingRow& row = *found.row;
  const auto timing = [&settings, &row, value](std::uint16_t& member) {
    const std::uint16_t before = member;
    const Refusal refusal = set_number(member, row, value);
    if (settings.heartbeat_ms < settings.timeout_ms) return refusal;
    member = before;
    return Refusal::range;
  };
  switch (row.setting) {
    case Setting::rate:
      return set_number(settings.state_rate_hz, row, value);
    case Setting::heartbeat:
      return timing(settings.heartbeat_ms);
    case Setting::timeout:
      return timing(settings.timeout_ms);
    case Setting::recovery:
      return set_recovery(settings, value);
    case Setting::pack:
      return set_number(settings.pack, row, value);
    case Setting::i2c:
      return parse_poll(value, settings.polls[found.number - 1]);
    case Setting::uart:
      return parse_uart_mode(value, settings.uarts[found.number - 1]);
    default:
      return set(settings.site, found, value);
  }
}

bool operator==(const Settings& a, const Settings& b) {
  return a.state_rate_hz == b.state_rate_hz && a.heartbeat_ms == b.heartbeat_ms &&
         a.timeout_ms == b.timeout_ms && a.recovery == b.recovery && a.pack == b.pack &&
         same_elements(a.polls, b.polls) && same_elements(a.uarts, b.uarts) && a.site == b.site;
}

bool write_settings(const Settings& settings, char* out, std::size_t capacity, Text& text) {
  Lines lines(out, capacity);
  const auto add_number = [&lines](Setting setting, std::uint32_t number) {
    char digits[max_number_text];
    const char* const end = write_number(digits, number);
    lines.add(row_of(setting).key, Text(digits, static_cast<std::size_t>(end - digits)));
  };
  add_number(Setting::rate, settings.state_rate_hz);
  add_number(Setting::heartbeat, settings.heartbeat_ms);
  add_number(Setting::timeout, settings.timeout_ms);
  lines.add("recovery", settings.recovery == Recovery::last ? Text("last") : Text("rearm"));
  add_number(Setting::pack, settings.pack ? 1 : 0);
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
  settings.site.lose_wiring();
  // Twice, because a heartbeat interval may need the longer timeout of a later line.
  for (int round = 0; round < 2; ++round) {
    for (Text rest = text; !rest.empty();) {
      const std::size_t line = position(rest, '\n');
      const std::size_t comma = position(rest, ',');
      if (comma < line) {
        const Text key = rest.substr(0, comma);
        const Refusal refusal = set(settings, key, rest.substr(comma + 1, line - comma - 1));
        if (refusal != Refusal::none && key == row_of(Setting::wiring).key) {
          settings.site.lose_wiring();
        }
      }
      rest = line == rest.size() ? Text() : rest.substr(line + 1);
    }
  }
}

}  // namespace r4
