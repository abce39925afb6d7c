// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/recordings/record_line.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <limits>

#include "../../protocol/datagram/numbers.hpp"
#include "../../protocol/messages/site_settings.hpp"
#include "r4link/config.hpp"

namespace r4 {
namespace {

using std::chrono::days;
using std::chrono::sys_days;
using std::chrono::year_month_day;

constexpr std::chrono::seconds second{1};
constexpr std::size_t decimals = 6;
constexpr std::string_view header_words = "# r4log ";
constexpr std::string_view path_words = "# path ";
constexpr std::string_view device_words = "# device ";
constexpr std::string_view hex_digits = "0123456789abcdef";
constexpr std::string_view kind_marks = "<>!";  // in the order of RecordKind

constexpr Time end_of_time =
    sys_days{year_month_day{std::chrono::year{9999}, std::chrono::month{12}, std::chrono::day{31}}}
        .time_since_epoch() +
    days{1} - Time{1};

bool is_plain(char c) { return c >= ' ' && c <= '~' && c != '\\'; }

void append(std::string& out, std::string_view bytes, bool escapes_blanks) {
  for (const char c : bytes) {
    if (is_plain(c) && !(escapes_blanks && c == ' ')) {
      out += c;
    } else {
      const auto byte = static_cast<unsigned char>(c);
      out += {'\\', 'x', hex_digits[byte >> 4], hex_digits[byte & 15]};
    }
  }
}

// Appends "# path 1 WORD". Escapes spaces within WORD, because spaces separate words.
void append_of_path(std::string& out, std::string_view words, std::uint16_t path,
                    std::string_view word) {
  out.append(words).append(std::to_string(path)) += ' ';
  append(out, word, true);
}

// Writes "1795468293.404765" at `out`, and returns its end.
char* write_time(char* out, Time time) {
  time = std::clamp(time, Time{0}, end_of_time);
  out = write_number(out, static_cast<std::uint64_t>(time / second));
  *out = '.';
  std::int64_t micros = (time % second).count();
  for (std::size_t i = decimals; i > 0; --i, micros /= 10) {
    out[i] = static_cast<char>('0' + micros % 10);
  }
  return out + 1 + decimals;
}

bool read_time(std::string_view text, Time& out) {
  const std::size_t point = text.find('.');
  std::uint64_t seconds = 0;
  std::uint32_t micros = 0;
  if (point == std::string_view::npos || text.size() != point + 1 + decimals) return false;
  if (!parse_number(Text(text.substr(0, point)), seconds) ||
      seconds > static_cast<std::uint64_t>(end_of_time / second) ||
      !parse_number(Text(text.substr(point + 1)), micros)) {
    return false;
  }
  out = Time{seconds * 1'000'000 + micros};
  return true;
}

// Removes the number at the front of `text`, and `end` after the number.
bool take_number(std::string_view& text, char end, std::uint32_t limit, std::uint32_t& out) {
  const std::size_t size = text.find(end);
  const std::string_view digits = text.substr(0, size);
  if (!parse_number(Text(digits), out) || out > limit) return false;
  text.remove_prefix(size == std::string_view::npos ? text.size() : size + 1);
  return true;
}

constexpr std::uint32_t max_path = std::numeric_limits<std::uint16_t>::max();

// Reads "1 WORD" or "1 WORD OTHER".
bool read_of_path(std::string_view text, std::uint16_t& path, std::string& word,
                  std::string& other) {
  std::uint32_t number = 0;
  if (!take_number(text, ' ', max_path, number) || number == no_path) return false;
  path = static_cast<std::uint16_t>(number);
  word.clear();
  other.clear();
  const std::size_t blank = text.find(' ');
  if (!append_unescaped(word, text.substr(0, blank))) return false;
  return blank == std::string_view::npos || append_unescaped(other, text.substr(blank + 1));
}

LineKind damaged(RecordLine& out, const char* why) {
  out.problem = why;
  return LineKind::damaged;
}

LineKind read_comment(std::string_view line, RecordLine& out) {
  if (line.starts_with(header_words)) {
    line.remove_prefix(header_words.size());
    return take_number(line, ' ', std::numeric_limits<std::uint32_t>::max(), out.version)
               ? LineKind::header
               : damaged(out, "the header has no version");
  }
  if (line.starts_with(path_words)) {
    line.remove_prefix(path_words.size());
    if (!read_of_path(line, out.path.number, out.path.url, out.path.name)) {
      return damaged(out, "the line is not in the form of a path");
    }
    // Drops an invalid board name, because programs use names as table cells, topics or labels.
    if (!is_board_id(Text(out.path.name))) out.path.name.clear();
    return LineKind::path;
  }
  if (line.starts_with(device_words)) {
    line.remove_prefix(device_words.size());
    // A person's comment may begin with the same words.
    if (line.empty() || line[0] < '0' || line[0] > '9') return LineKind::comment;
    RecordedDevice& device = out.device;
    return read_of_path(line, device.path, device.place, device.description) &&
                   std::all_of(device.place.begin(), device.place.end(), is_plain)
               ? LineKind::device
               : damaged(out, "the line is not in the form of a device");
  }
  return LineKind::comment;
}

LineKind read_record(std::string_view line, RecordLine& out) {
  const std::size_t time_size = line.find(' ');
  if (time_size == std::string_view::npos ||
      !read_time(line.substr(0, time_size), out.record.time)) {
    return damaged(out, "the line does not begin with a time");
  }
  line.remove_prefix(time_size + 1);
  const std::size_t blank = line.find(' ');
  const bool has_mark = blank != std::string_view::npos && blank >= 2;
  const std::size_t kind = has_mark ? kind_marks.find(line[blank - 1]) : std::string_view::npos;
  std::uint32_t path = 0;
  if (kind == std::string_view::npos || !parse_number(Text(line.substr(0, blank - 1)), path) ||
      path > max_path) {
    return damaged(out, "a path and a direction do not follow the time");
  }
  out.record.kind = static_cast<RecordKind>(kind);
  out.record.path = static_cast<std::uint16_t>(path);
  out.text.clear();
  if (!append_unescaped(out.text, line.substr(blank + 1))) {
    return damaged(out, "a byte that is not printable is not written as \\xNN");
  }
  if (out.text.size() > max_record_bytes)
    return damaged(out, "the line is longer than a record can be");
  out.record.bytes = out.text;
  return LineKind::record;
}

}  // namespace

void append_escaped(std::string& out, std::string_view bytes) { append(out, bytes, false); }

bool append_unescaped(std::string& out, std::string_view text) {
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (is_plain(text[i])) {
      out += text[i];
      continue;
    }
    if (text[i] != '\\' || text.size() - i < 4 || text[i + 1] != 'x') return false;
    const std::size_t high = hex_digits.find(text[i + 2]);
    const std::size_t low = hex_digits.find(text[i + 3]);
    if (high == std::string_view::npos || low == std::string_view::npos) return false;
    out += static_cast<char>(high << 4 | low);
    i += 3;
  }
  return true;
}

Record without_secrets(Record record, RecordRoom& room) {
  record.bytes = record.bytes.substr(0, max_record_bytes);
  // Only this event contains received bytes.
  constexpr std::string_view oversize = "oversize ";
  std::size_t before = 0;
  if (record.kind == RecordKind::event) {
    if (!record.bytes.starts_with(oversize)) return record;
    before = oversize.size();
    std::copy(oversize.begin(), oversize.end(), room.begin());
  }
  const Text bytes(record.bytes.substr(before));
  const Text masked = without_secrets(bytes, room.data() + before);
  if (masked.data() != bytes.data()) record.bytes = {room.data(), before + masked.size()};
  return record;
}

void write_record_header(std::string& out) {
  out.append(header_words) += std::to_string(record_version);
  out += " by r4 " R4LINK_VERSION
         "\n# seconds since 1970 (UTC), the number of the path, < from the board > to the board ! "
         "event; \\xNN is a byte\n";
}

void write_path(std::string& out, const RecordedPath& path) {
  append_of_path(out, path_words, path.number, path.url);
  if (!path.name.empty()) append(out += ' ', path.name, true);
  out += '\n';
}

void write_device(std::string& out, const RecordedDevice& device) {
  append_of_path(out, device_words, device.path, device.place);
  append_escaped(out += ' ', std::string_view(device.description).substr(0, max_record_bytes));
  out += '\n';
}

void write_record(std::string& out, const Record& record) {
  std::array<char, 2 * max_number_text + decimals> head;
  char* end = write_time(head.data(), record.time);
  *end++ = ' ';
  end = write_number(end, std::uint32_t{record.path});
  *end++ = kind_marks[static_cast<std::size_t>(record.kind)];
  *end++ = ' ';
  out.append(head.data(), static_cast<std::size_t>(end - head.data()));
  append_escaped(out, record.bytes.substr(0, max_record_bytes));
  out += '\n';
}

void write_beginning(std::string& out, Time time) {
  out += "# from " + record_time_text(time) + '\n';
}

bool read_record_line(std::string_view line, RecordLine& out) {
  out.kind = line.starts_with('#') ? read_comment(line, out) : read_record(line, out);
  return out.kind != LineKind::damaged;
}

std::string record_time_text(Time time) {
  time = std::clamp(time, Time{0}, end_of_time);
  const auto day = std::chrono::floor<days>(time);
  const year_month_day date{sys_days{day}};
  const std::chrono::hh_mm_ss clock{time - day};
  return fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}.{:06}Z", int{date.year()},
                     unsigned{date.month()}, unsigned{date.day()}, clock.hours().count(),
                     clock.minutes().count(), clock.seconds().count(), clock.subseconds().count());
}

// Formats the result and compares it with `text`, to find every invalid character and number.
std::optional<Time> read_record_time(std::string_view text) {
  constexpr std::string_view form = "0000-00-00T00:00:00.000000Z";
  constexpr std::size_t whole_seconds = 19;
  if (text.ends_with('Z')) text.remove_suffix(1);
  if (text.size() < whole_seconds || text.size() >= form.size() || text.ends_with('.')) {
    return std::nullopt;
  }
  const std::string all = std::string(text) + std::string(form.substr(text.size()));
  const auto number = [&all](std::size_t at, std::size_t count) {
    std::uint32_t value = 0;
    return parse_number(Text(all.data() + at, count), value) ? value : 0;
  };
  const year_month_day date{std::chrono::year{static_cast<int>(number(0, 4))},
                            std::chrono::month{number(5, 2)}, std::chrono::day{number(8, 2)}};
  if (!date.ok()) return std::nullopt;
  const Time time = sys_days{date}.time_since_epoch() + std::chrono::hours{number(11, 2)} +
                    std::chrono::minutes{number(14, 2)} + std::chrono::seconds{number(17, 2)} +
                    Time{number(20, decimals)};
  if (record_time_text(time) != all) return std::nullopt;
  return time;
}

}  // namespace r4
