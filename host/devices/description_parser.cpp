// SPDX-License-Identifier: GPL-3.0-or-later
#include "description_parser.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numbers>
#include <utility>

#include "../../protocol/datagram/numbers.hpp"
#include "r4link/error.hpp"
#include "r4link/vocabulary.hpp"

namespace r4 {

namespace {

constexpr std::size_t longest_line = 400;
constexpr std::size_t longest_name = 32;
constexpr std::size_t longest_unit = 16;
constexpr std::size_t most_addresses = 16;
constexpr int longest_wait_ms = 5000;
constexpr double largest_factor = 1e30;  // its inverse is the smallest factor; both fit a float

std::string_view trimmed(std::string_view line) {
  constexpr std::string_view blanks = " \t\r";
  const std::size_t first = line.find_first_not_of(blanks);
  if (first == std::string_view::npos) return {};
  return line.substr(first, line.find_last_not_of(blanks) - first + 1);
}

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  while (!line.empty()) {
    const std::size_t end = std::min(line.find_first_of(" \t"), line.size());
    words.push_back(line.substr(0, end));
    line = trimmed(line.substr(end));
  }
  return words;
}

bool is_printable(std::string_view text) {
  return std::all_of(text.begin(), text.end(), [](char c) { return c >= ' ' && c <= '~'; });
}

// Reads "u8", "i16be". False: not a valid type.
bool read_type(std::string_view word, DeviceValue& value) {
  if (word.size() < 2 || (word[0] != 'u' && word[0] != 'i')) return false;
  value.is_signed = word[0] == 'i';
  word.remove_prefix(1);
  value.big_endian = word.ends_with("be");
  const bool ordered = value.big_endian || word.ends_with("le");
  if (ordered) word.remove_suffix(2);
  constexpr std::string_view widths[] = {"8", "16", "24", "32"};
  const auto* const width = std::find(std::begin(widths), std::end(widths), word);
  if (width == std::end(widths)) return false;
  value.size = static_cast<int>(width - std::begin(widths)) + 1;
  value.high_bit = 8 * value.size - 1;
  return ordered == (value.size > 1);
}

}  // namespace

DeviceDescription DescriptionParser::parse(std::string_view text) {
  if (text.size() > DeviceDescription::max_text) {
    fail(fmt::format("the file has more than {} bytes", DeviceDescription::max_text),
         "give a description of a device, which is a short text");
  }
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    ++line_;
    take_line(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  require_whole();
  return std::move(result_);
}

void DescriptionParser::take_line(std::string_view line) {
  if (line.size() > longest_line) {
    fail(fmt::format("the line has more than {} characters", longest_line), "shorten it");
  }
  line = trimmed(line.substr(0, line.find('#')));
  if (line.empty()) return;
  const Words words = words_of(line);
  const std::string_view what = words.front();
  if (result_.name.empty() && what != "device") {
    fail("the description does not begin with its name", "write as the first line: device NAME");
  }
  if (what == "device") return take_name(words);
  if (what == "title") return take_title(trimmed(line.substr(what.size())));
  if (what == "role") return take_role(words);
  if (what == "address") return take_addresses(words);
  if (what == "check") return take_check(words);
  if (what == "lookalike") return take_lookalike(words, line);
  if (what == "write") return take_write(words);
  if (what == "poll") return take_poll(words);
  if (what == "value") return take_value(words);
  if (what == "ready") return take_ready(words);
  fail(fmt::format("\"{}\" is not a valid word",
                   is_printable(what) ? what.substr(0, longest_name) : "this"),
       "use device, title, role, address, check, lookalike, write, poll, value or ready");
}

void DescriptionParser::take_name(const Words& words) {
  require_words(words, 2, 2, "device NAME");
  if (!result_.name.empty())
    fail("the device has a name already", "give each device a file of its own");
  result_.name = name_of(words[1]);
}

void DescriptionParser::take_title(std::string_view title) {
  if (!result_.title.empty()) fail("the device has a title already", "leave this line out");
  if (title.empty() || !is_printable(title)) {
    fail("the title is empty, or not plain text", "write a title: title TEXT");
  }
  result_.title = title;
}

void DescriptionParser::take_role(const Words& words) {
  require_words(words, 2, 2, "role imu");
  if (result_.role != DeviceRole::none)
    fail("the device has a role already", "leave this line out");
  for (const DeviceRole role :
       {DeviceRole::imu, DeviceRole::power, DeviceRole::range, DeviceRole::angle}) {
    if (words[1] == to_text(role)) {
      result_.role = role;
      return;
    }
  }
  fail("this is not a valid role", "use imu, power, range or angle, or leave the line out");
}

void DescriptionParser::take_addresses(const Words& words) {
  require_words(words, 2, most_addresses + 1, "address 0x28 0x29");
  for (std::size_t i = 1; i < words.size(); ++i) {
    const int address = number(words[i], i2c_first_address, i2c_last_address, "an address");
    if (std::count(result_.addresses.begin(), result_.addresses.end(), address) != 0) {
      fail("an address is named twice", "name each address once");
    }
    require_room(result_.addresses.size(), most_addresses, "addresses");
    result_.addresses.push_back(address);
  }
}

void DescriptionParser::take_check(const Words& words) {
  require_words(words, 3, 3, "check REGISTER BYTES, such as check x75 x68");
  require_room(result_.checks.size(), DeviceDescription::max_lines, "checks");
  result_.checks.push_back({bytes(words[1], 0, i2c_max_register_bytes, "a register"),
                            bytes(words[2], 1, i2c_max_bytes, "the expected value")});
}

void DescriptionParser::take_lookalike(const Words& words, std::string_view line) {
  constexpr std::size_t longest_title = 120;
  require_words(words, 4, longest_line, "lookalike REGISTER BYTES TITLE");
  require_room(result_.lookalikes.size(), DeviceDescription::max_lines, "lookalikes");
  DeviceLookalike other{bytes(words[1], 0, i2c_max_register_bytes, "a register"),
                        bytes(words[2], 1, i2c_max_bytes, "the value found"),
                        {}};
  other.title = line.substr(static_cast<std::size_t>(words[3].data() - line.data()));
  if (other.title.size() > longest_title || !is_printable(other.title)) {
    fail("the title is too long, or not plain text",
         fmt::format("write a title of at most {} plain characters", longest_title));
  }
  result_.lookalikes.push_back(std::move(other));
}

void DescriptionParser::take_write(const Words& words) {
  constexpr const char* form = "write BYTES [wait MS], such as write x6b00 wait 50";
  require_words(words, 2, 4, form);
  if (words.size() == 3 || (words.size() == 4 && words[2] != "wait")) {
    fail("the line does not have the form of its word", std::string("write it as ") + form);
  }
  require_room(result_.writes.size(), DeviceDescription::max_lines, "writes");
  DeviceWrite write{bytes(words[1], 1, i2c_max_bytes, "the written value"),
                    std::chrono::milliseconds{0}};
  if (words.size() == 4) {
    write.wait = std::chrono::milliseconds{number(words[3], 0, longest_wait_ms, "the wait in ms")};
  }
  result_.writes.push_back(std::move(write));
}

void DescriptionParser::take_poll(const Words& words) {
  require_words(words, 5, 5, "poll NAME REGISTER COUNT PERIOD, such as poll motion x3b 14 10");
  if (result_.polls.size() == i2c_slots) {
    fail(fmt::format("the board repeats at most {} readings", i2c_slots),
         "read neighbouring registers with one poll");
  }
  DevicePoll poll;
  poll.name = name_of(words[1]);
  for (const DevicePoll& other : result_.polls) {
    if (other.name == poll.name) fail("a poll has this name already", "choose another name");
  }
  poll.register_bytes = bytes(words[2], 0, i2c_max_register_bytes, "a register");
  poll.count = number(words[3], 1, i2c_max_bytes, "the count of bytes");
  poll.period = std::chrono::milliseconds{
      number(words[4], i2c_min_period_ms, i2c_max_period_ms, "the period in ms")};
  result_.polls.push_back(std::move(poll));
}

void DescriptionParser::take_value(const Words& words) {
  require_words(words, 5, 20, "value NAME POLL BYTE TYPE, and options");
  require_room(result_.values.size(), DeviceDescription::max_lines, "values");
  DeviceValue value;
  value.name = name_of(words[1]);
  if (result_.find(value.name)) fail("a value has this name already", "choose another name");
  const auto poll = std::find_if(result_.polls.begin(), result_.polls.end(),
                                 [&](const DevicePoll& each) { return each.name == words[2]; });
  if (poll == result_.polls.end()) {
    fail("a poll of this name is not defined above",
         "name a poll from above, or move this line below the poll");
  }
  value.poll = static_cast<std::size_t>(poll - result_.polls.begin());
  value.at = number(words[3], 0, i2c_max_bytes - 1, "the first byte");
  if (!read_type(words[4], value)) {
    fail("this is not a valid type",
         "use u8, i8, or u or i, then 16, 24 or 32, then le or be, such as i16be");
  }
  if (value.at + value.size > poll->count) {
    fail(fmt::format("the value ends after the {} bytes of its poll", poll->count),
         "read more bytes, or begin at an earlier byte; bytes count from 0");
  }
  take_options(words, 5, value);
  result_.values.push_back(std::move(value));
}

void DescriptionParser::take_ready(const Words& words) {
  require_words(words, 2, 3, "ready VALUE, or ready VALUE NUMBER");
  require_room(result_.ready.size(), DeviceDescription::max_lines, "lines that begin with ready");
  const auto value = result_.find(words[1]);
  if (!value)
    fail("a value of this name is not defined above",
         "name a value from above, or move this line below the value");
  DeviceReady ready{*value, std::nullopt};
  if (words.size() == 3) ready.number = factor(words[2], "the number after ready");
  result_.ready.push_back(ready);
}

void DescriptionParser::take_options(const Words& words, std::size_t first, DeviceValue& value) {
  Words seen;
  for (std::size_t i = first; i < words.size();) {
    const std::string_view what = words[i];
    if (std::count(seen.begin(), seen.end(), what) != 0) {
      fail("a word is named twice", "name each word once");
    }
    seen.push_back(what);
    const std::size_t needs = what == "range" || what == "only" ? 2 : 1;
    if (i + needs >= words.size())
      fail("a word is missing at the end of the line", "add the number");
    const std::string_view word = words[i + 1];
    if (what == "bits") {
      const std::size_t dots = std::min(word.find(".."), word.size());
      const int most = 8 * value.size - 1;
      value.low_bit = number(word.substr(0, dots), 0, most, "the lowest bit");
      value.high_bit = number(word.substr(std::min(dots + 2, word.size())), value.low_bit, most,
                              "the highest bit");
    } else if (what == "scale") {
      value.scale = factor(word, "the scale");
      if (value.scale == 0) fail("the scale is 0", "write the size of one step, such as 0.01");
    } else if (what == "offset") {
      value.offset = factor(word, "the offset");
    } else if (what == "unit") {
      if (word.size() > longest_unit || !is_printable(word) ||
          word.find_first_of(",\"[]\\") != std::string_view::npos) {
        fail("this is not a valid unit",
             "write the unit in plain characters, such as m/s2, rad/s or degC");
      }
      value.unit = word;
    } else if (what == "range") {
      value.minimum = factor(word, "the range");
      value.maximum = factor(words[i + 2], "the range");
      if (value.minimum >= value.maximum) fail("the range is empty", "write range MIN MAX");
    } else if (what == "only") {
      const auto other = result_.find(word);
      if (!other)
        fail("a value of this name is not defined above",
             "name a value from above, or move this line below the value");
      value.only = {*other, factor(words[i + 2], "the number after only")};
    } else {
      fail("a word of the value is not known", "use bits, scale, offset, unit, range or only");
    }
    i += 1 + needs;
  }
}

void DescriptionParser::require_whole() {
  line_ = 0;
  if (result_.name.empty()) fail("the description is empty", "begin with the line: device NAME");
  if (result_.addresses.empty()) fail("the device has no address", "add a line: address 0x28");
  if (result_.polls.empty())
    fail("the device has no poll", "add a line: poll NAME REGISTER COUNT PERIOD");
  if (result_.values.empty())
    fail("the device has no value", "add a line: value NAME POLL BYTE TYPE");
  require_role();
}

void DescriptionParser::require_role() {
  if (result_.role == DeviceRole::imu) {
    for (const char* name : {"accel_x", "accel_y", "accel_z"}) require_value(name, "m/s2");
    for (const char* name : {"gyro_x", "gyro_y", "gyro_z"}) require_value(name, "rad/s");
    constexpr const char* quaternion[] = {"quat_w", "quat_x", "quat_y", "quat_z"};
    const bool turned = std::any_of(std::begin(quaternion), std::end(quaternion),
                                    [this](const char* name) { return result_.find(name); });
    for (const char* name : quaternion) {
      if (turned) require_value(name, "");
    }
  } else if (result_.role == DeviceRole::power) {
    require_value("voltage", "V");
    require_value("current", "A");
  } else if (result_.role == DeviceRole::range) {
    require_value("distance", "m");
    if (!std::isfinite(result_.values[*result_.find("distance")].maximum)) {
      fail("the value distance has no range", "add to its line: range MIN MAX");
    }
  } else if (result_.role == DeviceRole::angle) {
    require_value("angle", "rad");
  }
}

void DescriptionParser::require_value(const char* name, const char* unit) {
  const auto found = result_.find(name);
  if (found && result_.values[*found].unit == unit) return;
  const std::string wanted = *unit == 0 ? "without a unit" : std::string("in ") + unit;
  fail(fmt::format("the role {} needs a value {} {}", to_text(result_.role), name, wanted),
       "add that value, or leave the role out");
}

void DescriptionParser::require_words(const Words& words, std::size_t least, std::size_t most,
                                      const char* form) {
  if (words.size() >= least && words.size() <= most) return;
  fail(fmt::format("the line has {} words", words.size()), std::string("write it as ") + form);
}

void DescriptionParser::require_room(std::size_t used, std::size_t most, const char* what) {
  if (used >= most)
    fail(fmt::format("the description has more than {} {}", most, what), "leave out some of them");
}

std::string DescriptionParser::name_of(std::string_view word) {
  const bool right = word.size() <= longest_name && word[0] >= 'a' && word[0] <= 'z' &&
                     std::all_of(word.begin(), word.end(), [](char c) {
                       return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_';
                     });
  if (!right) {
    fail("this is not a valid name",
         fmt::format("use up to {} characters of a-z, 0-9 and _, beginning with a letter",
                     longest_name));
  }
  return std::string(word);
}

int DescriptionParser::number(std::string_view word, int least, int most, const char* what) {
  std::uint32_t value = 0;
  const bool read = word.starts_with("0x") ? parse_hex(Text(word.substr(2)), value)
                                           : parse_number(Text(word), value);
  if (!read) {
    fail(fmt::format("{} is not a number", what),
         fmt::format("write {} to {}, or in hexadecimal 0x{:x}", least, most, most));
  }
  if (value < static_cast<std::uint32_t>(least) || value > static_cast<std::uint32_t>(most)) {
    fail(fmt::format("{} is out of range", what), fmt::format("give {} to {}", least, most));
  }
  return static_cast<int>(value);
}

// Reads "9.80665/16384", "pi/180/131" or "-40".
double DescriptionParser::factor(std::string_view word, const char* what) {
  double result = 1;
  char joined = '*';
  for (bool more = true; more;) {
    const std::size_t end = std::min(word.find_first_of("*/"), word.size());
    const std::string_view each = word.substr(0, end);
    double value = std::numbers::pi;
    const auto read = std::from_chars(each.data(), each.data() + each.size(), value);
    const bool is_pi = each == "pi";
    if (is_pi) value = std::numbers::pi;
    const bool right = is_pi || (read.ec == std::errc() && read.ptr == each.data() + each.size());
    if (!right || !std::isfinite(value) || (joined == '/' && value == 0)) {
      fail(fmt::format("{} is not a number", what), "write it as 0.01, 9.80665/16384 or pi/180");
    }
    result = joined == '*' ? result * value : result / value;
    const double size = std::abs(result);
    if (size > largest_factor || (size < 1 / largest_factor && result != 0)) {
      fail(fmt::format("{} is out of range", what),
           "give 0, or a number whose size is from 1e-30 to 1e30");
    }
    more = end < word.size();
    if (more) joined = word[end];
    word.remove_prefix(std::min(end + 1, word.size()));
  }
  return result;
}

std::vector<std::uint8_t> DescriptionParser::bytes(std::string_view word, std::size_t least,
                                                   std::size_t most, const char* what) {
  const std::size_t count = word.size() / 2;
  std::vector<std::uint8_t> result(count);
  if (word.size() % 2 != 1 || word[0] != 'x' ||
      !parse_hex(Text(word.substr(1)), result.data(), count)) {
    fail(fmt::format("{} is not in the form of bytes", what),
         "write x and two hexadecimal digits for each byte, such as x3b00; x alone means no bytes");
  }
  if (count < least || count > most) {
    fail(fmt::format("{} has {} bytes", what, count),
         fmt::format("give {} to {} bytes", least, most));
  }
  return result;
}

void DescriptionParser::fail(const std::string& reason, const std::string& fix) const {
  const std::string place = line_ == 0 ? source_ : fmt::format("{}, line {}", source_, line_);
  throw Error(ErrorKind::data, place, reason, fix);
}

}  // namespace r4
