// SPDX-License-Identifier: GPL-3.0-or-later
// One line of candump output, in either format:
//     candump -L    (1436509052.249713) vcan0 244#2A366C2B     ## and a digit of flags for CAN FD,
//                                                              #R for a remote request
//     candump        (1436509052.249713)  vcan0  244   [4]  2A 36 6C 2B
// Reads the extras of options -a, -x, -8 and -t (the time may be missing, relative or a date) and
// python-can's channel names. Recognizes CAN XL frames. Any input is safe; nothing is stored.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "r4link/can/can_frame.hpp"

namespace r4::tool {

struct CandumpLine {
  std::string_view time;                 // as written; empty: none
  std::optional<std::uint64_t> time_us;  // since the epoch, or since the log's own start
  bool date = false;                     // `time` is a date in an unknown time zone
  std::string_view interface;
  CanFrame frame{};
  bool error_frame = false;  // a report of the controller, not a frame on the bus
  bool xl = false;           // a CAN XL frame, which R4 does not use; `frame` is remote
};

enum class CandumpError : std::uint8_t {
  none,
  detail,   // no frame: explains the previous line (candump -e)
  dropped,  // no frame: candump -d was too slow
  no_frame,
  time,
  interface,
  id,  // not 3 or 8 hexadecimal digits, or out of range
  size,
  cut,  // fewer bytes than stated, or half a byte
  bytes,
  rest,
};

// True for 1 to 64 printable ASCII characters without blanks, as candump and python-can use.
bool is_interface_name(std::string_view name);

const char* to_text(CandumpError error);

// `line` is without its end; `out` refers to it and is complete only if the result is `none`.
CandumpError read_candump_line(std::string_view line, CandumpLine& out);

}  // namespace r4::tool
