// SPDX-License-Identifier: GPL-3.0-or-later
// Reads a device description line by line. The first word of a line is its kind:
//     device NAME                                             once, first
//     title TEXT
//     role imu|power|range|angle
//     address A [A…]
//     check REGISTER BYTES
//     lookalike REGISTER BYTES TITLE
//     write BYTES [wait MS]
//     poll NAME REGISTER COUNT PERIOD
//     value NAME POLL BYTE TYPE [bits LOW..HIGH] [scale S] [offset O] [unit U] [range MIN MAX]
//           [only VALUE NUMBER]
//     ready VALUE [NUMBER]
//
// '#' starts a comment. BYTES: x and two hex digits a byte. S, O: numbers and pi with * and /.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "r4link/devices/description.hpp"

namespace r4 {

class DescriptionParser {
 public:
  explicit DescriptionParser(std::string source) : source_(std::move(source)) {}
  // Throws Error{data}.
  DeviceDescription parse(std::string_view text);

 private:
  using Words = std::vector<std::string_view>;

  void take_line(std::string_view line);
  void take_name(const Words& words);
  void take_title(std::string_view title);
  void take_role(const Words& words);
  void take_addresses(const Words& words);
  void take_check(const Words& words);
  void take_lookalike(const Words& words, std::string_view line);
  void take_write(const Words& words);
  void take_poll(const Words& words);
  void take_value(const Words& words);
  void take_ready(const Words& words);
  void take_options(const Words& words, std::size_t first, DeviceValue& value);
  void require_whole();
  void require_role();
  void require_value(const char* name, const char* unit);

  void require_words(const Words& words, std::size_t least, std::size_t most, const char* form);
  void require_room(std::size_t used, std::size_t most, const char* what);
  std::string name_of(std::string_view word);
  int number(std::string_view word, int least, int most, const char* what);
  double factor(std::string_view word, const char* what);
  std::vector<std::uint8_t> bytes(std::string_view word, std::size_t least, std::size_t most,
                                  const char* what);
  [[noreturn]] void fail(const std::string& reason, const std::string& fix) const;

  std::string source_;
  int line_ = 0;  // 0: the error does not belong to one line
  DeviceDescription result_;
};

}  // namespace r4
