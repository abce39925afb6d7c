// SPDX-License-Identifier: GPL-3.0-or-later
// The first byte of a packed datagram: the layout, and the sizes of PNum and T
// (docs/reference/packed.md).
#pragma once

#include <cstddef>
#include <cstdint>

#include "packed_words.hpp"

namespace r4 {
namespace packed {

// Fields in the order of the datagram; "more" is any number of fields with names.
enum class Layout : std::uint8_t {
  plain_fields,     // more: PNum and T, if any, are among them
  fields,           // more, PNum, T
  state,            // the ten default fields of the state, more, PNum, T
  state_safe_cmd,   // the ten default fields, SAFE, CMD, more, PNum, T
  full_state,       // all state fields, more, PNum, T
  board_heartbeat,  // H:R4-ROS2, PNum, T, more
  host_heartbeat,   // H:ROS2-R4, SID, PNum, T, more
  of_session,       // more, SID, PNum: a command
};

constexpr std::uint8_t version_bits = 0x80;  // bits of version 1
constexpr std::uint8_t version_mask = 0xC0;

constexpr unsigned default_fields = code_servo1pos + 1;

constexpr unsigned nameless_fields(Layout layout) {
  return layout == Layout::state            ? default_fields
         : layout == Layout::state_safe_cmd ? default_fields + 2
         : layout == Layout::full_state     ? state_words
                                            : 0;
}

// `index` must be below nameless_fields().
constexpr unsigned nameless_code(Layout layout, unsigned index) {
  return layout == Layout::state_safe_cmd && index >= default_fields
             ? code_safe + (index - default_fields)
             : index;
}

constexpr bool is_heartbeat(Layout layout) {
  return layout == Layout::board_heartbeat || layout == Layout::host_heartbeat;
}

// True if SID is before PNum, without its name.
constexpr bool has_session(Layout layout) {
  return layout == Layout::host_heartbeat || layout == Layout::of_session;
}

// Digits of PNum and T, by the head's last three bits; a writer uses the first sufficient entry.
struct Sizes {
  std::uint8_t pnum;
  std::uint8_t time;
};
constexpr Sizes sizes[8] = {{0, 0}, {4, 5}, {4, 8}, {5, 8}, {6, 8}, {4, 11}, {8, 8}, {8, 11}};
constexpr Sizes session_sizes = {8, 0};
constexpr Sizes sizes_of(Layout layout, unsigned size) {
  return layout == Layout::of_session ? session_sizes : sizes[size];
}

constexpr unsigned digit_escape = 0xF;  // replaces a value: text follows
// Text: 0-9 are themselves.
constexpr unsigned digit_point = 0xA;
constexpr unsigned digit_minus = 0xB;
constexpr unsigned digit_comma = 0xC;
constexpr unsigned digit_end = 0xD;    // end of the field
constexpr unsigned digit_bytes = 0xE;  // a count (1-15), then that many bytes
constexpr unsigned digit_word = 0xF;   // then a code of two digits
// A name: a code of two digits, the first at most D; or E, a count (1-14), that many bytes.
constexpr unsigned digit_name = 0xE;
constexpr unsigned longest_name = 14;
constexpr unsigned longest_bytes = 15;
constexpr unsigned longest_count = 14;  // digits
constexpr unsigned most_device_bytes = 64;

constexpr unsigned flag_max = 0xE;
constexpr unsigned short3_max = 0xEFF;
constexpr unsigned drive_max = 0xEFFF;

constexpr std::size_t checksum_size = 4;

}  // namespace packed
}  // namespace r4
