// SPDX-License-Identifier: GPL-3.0-or-later
// One line of what candump prints, in either of its formats:
//
//     candump -L    (1436509052.249713) vcan0 244#2A366C2B       ## and a digit of flags for CAN FD,
//                                                                #R for a remote request
//     candump        (1436509052.249713)  vcan0  244   [4]  2A 36 6C 2B
//
// with the extras of its options -a, -x, -8 and -t; on screen the time may be missing, be counted from
// the start or be a date. Frames of CAN XL are recognised. Interfaces may have the names that python-can gives to
// its channels. Any bytes may come in; nothing is kept.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "r4link/can/can_frame.hpp"

namespace r4::tool {

struct CandumpLine {
  std::string_view time;                 // as it stands in the line; empty: none
  std::optional<std::uint64_t> time_us;  // since the epoch, or since whatever the dump counts from
  bool date = false;                     // the time is a date, of an unknown time zone
  std::string_view interface;
  CanFrame frame{};
  bool error_frame = false;  // a report of the controller's, no frame of the bus
  bool xl = false;           // a frame of CAN XL, which is not one of ours; `frame` is remote
};

enum class CandumpError : std::uint8_t {
  none,
  detail,     // no frame: a line of candump -e that explains the one before
  dropped,    // no frame: candump -d tells that it was too slow
  no_frame,   // not of either format
  time,       // what is in the parentheses is no time
  interface,  // not a name of an interface
  id,         // neither 3 nor 8 hexadecimal digits, or beyond what an id can be
  size,       // no frame has that many bytes
  cut,        // fewer bytes than the line says, or half of one
  bytes,      // a byte that is not two hexadecimal digits
  rest,       // something behind the frame
};

// True if candump or python-can may have written that name: 1 to 64 printable ASCII characters without blanks.
bool is_interface_name(std::string_view name);

// In words: "a byte that is not two hexadecimal digits".
const char* to_text(CandumpError error);

// Reads a line without its end. The views in `out` are into `line`; `out` is whole only if the
// result is none.
CandumpError read_candump_line(std::string_view line, CandumpLine& out);

}  // namespace r4::tool
