// SPDX-License-Identifier: GPL-3.0-or-later
#include "candump.hpp"

#include <algorithm>
#include <array>
#include <chrono>

#include "protocol/datagram/numbers.hpp"

namespace r4::tool {
namespace {

constexpr std::uint32_t error_flag = 0x20000000;  // in an 8-digit id: an error frame
constexpr std::uint32_t max_extended_id = 0x1FFFFFFF;
// Linux allows 15 characters, but python-can also uses an address, a path or a device number.
constexpr std::size_t max_interface_name = 64;
constexpr std::uint64_t max_seconds = 1'000'000'000'000;

constexpr std::array texts{
    "none",
    "a detail of the previous frame",
    "candump has lost frames here",
    "not a line of candump",
    "the time is not valid",
    "the name of the interface is not valid",
    "the id of the frame is not valid",
    "the number of bytes is not valid for a frame",
    "the line is cut off",
    "a byte that is not two hexadecimal digits",
    "the line has text after the frame",
};
static_assert(texts.size() == static_cast<std::size_t>(CandumpError::rest) + 1);

std::string_view take_word(std::string_view& text) {
  text.remove_prefix(std::min(text.find_first_not_of(' '), text.size()));
  const std::string_view word = text.substr(0, text.find(' '));
  text.remove_prefix(word.size());
  return word;
}

template <class Number>
bool read_digits(std::string_view text, Number& out) {
  return !text.empty() && text.find_first_not_of("0123456789") == std::string_view::npos &&
         parse_number(Text(text), out);
}

// Converts up to nine digits after the decimal point, "249713", to microseconds.
bool read_fraction(std::string_view text, std::uint32_t& out_us) {
  if (text.size() > 9) return false;
  std::array<char, 6> digits{'0', '0', '0', '0', '0', '0'};
  std::copy_n(text.data(), std::min(text.size(), digits.size()), digits.data());
  std::uint32_t all = 0;
  return read_digits(text, all) && read_digits({digits.data(), digits.size()}, out_us);
}

// Converts "2015-07-10 08:57:32" to seconds, assuming UTC.
bool read_date(std::string_view text, std::uint64_t& out_s) {
  constexpr std::string_view form = "dddd-dd-dd dd:dd:dd";
  if (text.size() != form.size()) return false;
  for (std::size_t i = 0; i < form.size(); ++i) {
    if (form[i] != 'd' && form[i] != text[i]) return false;
  }
  std::array<std::uint32_t, 6> parts{};
  constexpr std::array<std::size_t, 6> starts{0, 5, 8, 11, 14, 17};
  for (std::size_t i = 0; i < parts.size(); ++i) {
    if (!read_digits(text.substr(starts[i], i == 0 ? 4 : 2), parts[i])) return false;
  }
  using namespace std::chrono;  // NOLINT(google-build-using-namespace): the calendar's words
  const year_month_day day{year(static_cast<int>(parts[0])), month(parts[1]),
                           std::chrono::day(parts[2])};
  if (!day.ok() || parts[0] < 1970 || parts[3] > 23 || parts[4] > 59 || parts[5] > 60) return false;
  const auto days = static_cast<std::uint64_t>(sys_days(day).time_since_epoch().count());
  out_s = ((days * 24 + parts[3]) * 60 + parts[4]) * 60 + parts[5];
  return true;
}

bool read_time(std::string_view text, CandumpLine& out) {
  const std::size_t point = text.find('.');
  if (point == std::string_view::npos) return false;
  std::uint64_t seconds = 0;
  std::uint32_t microseconds = 0;
  const std::string_view whole = text.substr(0, point);
  out.date = whole.find('-') != std::string_view::npos;
  const bool read = out.date ? read_date(whole, seconds) : read_digits(whole, seconds);
  if (!read || seconds > max_seconds || !read_fraction(text.substr(point + 1), microseconds)) {
    return false;
  }
  out.time = text;
  out.time_us = seconds * 1'000'000 + microseconds;
  return true;
}

bool read_id(std::string_view text, CandumpLine& out) {
  std::uint32_t id = 0;
  // CAN XL: a priority, optionally after two digits of a virtual network id.
  if (out.xl) return (text.size() == 3 || text.size() == 5) && parse_hex(Text(text), id);
  if ((text.size() != 3 && text.size() != 8) || !parse_hex(Text(text), id)) return false;
  out.frame.extended = text.size() == 8;
  if (!out.frame.extended) {
    out.frame.id = id;
    return id <= max_can_id;
  }
  out.error_frame = (id & error_flag) != 0;
  out.frame.id = id & ~error_flag;
  return out.frame.id <= max_extended_id;
}

bool read_byte(std::string_view text, std::uint8_t& out) {
  std::uint32_t byte = 0;
  if (text.size() != 2 || !parse_hex(Text(text), byte)) return false;
  out = static_cast<std::uint8_t>(byte);
  return true;
}

// A CAN XL frame after the first #: flags, type, address, bytes: "81:00:12345678#112233".
bool is_xl_frame(std::string_view data) {
  constexpr std::string_view form = "hh:hh:hhhhhhhh#";
  if (data.size() < form.size()) return false;
  for (std::size_t i = 0; i < data.size(); ++i) {
    const bool digit = data[i] >= '0' && data[i] <= 'F' && (data[i] <= '9' || data[i] >= 'A');
    if (i >= form.size() || form[i] == 'h' ? !digit : data[i] != form[i]) return false;
  }
  return true;
}

// The text after the first # in the log format: "2A366C2B", "#12A36", "R", "R4", "R8_B".
CandumpError read_log_frame(std::string_view data, CanFrame& frame) {
  if (data.starts_with('R')) {
    frame.remote = true;
    data = data.substr(0, data.find('_'));  // skips a length code above 8
    return data.size() <= 2 ? CandumpError::none : CandumpError::rest;
  }
  if (data.starts_with('#')) {
    frame.fd = true;
    std::uint32_t flags = 0;
    if (data.size() < 2) return CandumpError::cut;
    if (!parse_hex(Text(data.substr(1, 1)), flags)) return CandumpError::bytes;
    data.remove_prefix(2);
  } else if (const std::size_t mark = data.find('_'); mark != std::string_view::npos) {
    data = data.substr(0, mark);  // skips a length code above 8
  }
  if (data.size() / 2 > max_fd_size) return CandumpError::size;
  frame.size = static_cast<std::uint8_t>(data.size() / 2);
  for (std::size_t i = 0; i < frame.size; ++i) {
    if (!read_byte(data.substr(2 * i, 2), frame.data[i])) return CandumpError::bytes;
  }
  if (data.size() % 2 != 0) return CandumpError::cut;
  return has_valid_size(frame) ? CandumpError::none : CandumpError::size;
}

// The bytes after "[4]", or "[04]" for CAN FD. "{B}", a length code above 8, means 8 bytes.
CandumpError read_screen_frame(std::string_view size, std::string_view& line, CanFrame& frame) {
  if (size.size() == 3 && size.front() == '{' && size.back() == '}') {
    if (size[1] < '9' || size[1] > 'F' || (size[1] > '9' && size[1] < 'A'))
      return CandumpError::size;
    size = "[8]";
  }
  if (size.size() < 3 || size.size() > 4 || size.front() != '[') return CandumpError::no_frame;
  std::uint32_t count = 0;
  if (size.back() != ']' || !read_digits(size.substr(1, size.size() - 2), count)) {
    return CandumpError::size;
  }
  frame.fd = size.size() == 4;
  if (count > max_fd_size) return CandumpError::size;
  frame.size = static_cast<std::uint8_t>(count);
  if (!has_valid_size(frame)) return CandumpError::size;
  std::string_view rest = line;
  if (take_word(rest) == "remote" && take_word(rest) == "request") {
    line = rest;
    frame.remote = true;
    return CandumpError::none;
  }
  for (std::size_t i = 0; i < count; ++i) {
    const std::string_view word = take_word(line);
    if (word.empty()) return CandumpError::cut;
    if (!read_byte(word, frame.data[i])) {
      return word.size() < 2 ? CandumpError::cut : CandumpError::bytes;
    }
  }
  return CandumpError::none;
}

bool one_of(std::string_view word, std::string_view a, std::string_view b) {
  return word == a || word == b;
}

}  // namespace

bool is_interface_name(std::string_view name) {
  return !name.empty() && name.size() <= max_interface_name &&
         std::all_of(name.begin(), name.end(), [](char c) { return c > ' ' && c <= '~'; });
}

const char* to_text(CandumpError error) {
  const auto index = static_cast<std::size_t>(error);
  return index < texts.size() ? texts[index] : "unknown";
}

CandumpError read_candump_line(std::string_view line, CandumpLine& out) {
  out = CandumpLine{};
  if (line.starts_with('\t')) return CandumpError::detail;
  if (line.starts_with("DROPCOUNT:")) return CandumpError::dropped;
  line.remove_prefix(std::min(line.find_first_not_of(' '), line.size()));
  if (line.starts_with('(')) {
    const std::size_t end = line.find(')');
    if (end == std::string_view::npos) return CandumpError::cut;
    if (!read_time(line.substr(1, end - 1), out)) return CandumpError::time;
    line.remove_prefix(end + 1);
  }
  out.interface = take_word(line);
  std::string_view word = take_word(line);
  if (word.empty()) return out.time.empty() ? CandumpError::no_frame : CandumpError::cut;
  const bool name = is_interface_name(out.interface);

  const std::size_t mark = word.find('#');
  if (mark != std::string_view::npos) {
    if (!name) return CandumpError::interface;
    out.xl = out.frame.remote = is_xl_frame(word.substr(mark + 1));
    if (!read_id(word.substr(0, mark), out)) return CandumpError::id;
    const CandumpError error =
        out.xl ? CandumpError::none : read_log_frame(word.substr(mark + 1), out.frame);
    if (error != CandumpError::none) return error;
    word = take_word(line);  // -x: T sent by this machine, R received
    if (!word.empty() && !one_of(word, "T", "R")) return CandumpError::rest;
    return take_word(line).empty() ? CandumpError::none : CandumpError::rest;
  }

  if (one_of(word, "TX", "RX")) {
    if (!one_of(take_word(line), "B", "-") || !one_of(take_word(line), "E", "-")) {
      return CandumpError::no_frame;
    }
    word = take_word(line);
  }
  const std::string_view size = take_word(line);
  if (size.empty() && !out.time.empty()) return CandumpError::cut;
  if (!size.starts_with('[') && !size.starts_with('{')) return CandumpError::no_frame;
  if (!name) return CandumpError::interface;
  out.xl = out.frame.remote = size.size() == 6;  // "[0008]"
  if (!read_id(word, out)) return CandumpError::id;
  if (out.xl) return CandumpError::none;
  const CandumpError error = read_screen_frame(size, line, out.frame);
  if (error != CandumpError::none) return error;
  line.remove_prefix(std::min(line.find_first_not_of(' '), line.size()));
  const bool known_rest = line.empty() || line.starts_with('\'') || line == "ERRORFRAME";
  return known_rest ? CandumpError::none : CandumpError::rest;
}

}  // namespace r4::tool
