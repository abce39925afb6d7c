// SPDX-License-Identifier: GPL-3.0-or-later
// The parts of a recording (docs/how-to/recordings.md). Each record has a time and a path.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "../link.hpp"

namespace r4 {

enum class RecordKind : std::uint8_t {
  from_board,  // a datagram, also a damaged one
  to_board,    // a datagram of any host
  event,       // in words
};

// A longer record is cut. Datagrams are shorter; damaged streams may have more bytes.
constexpr std::size_t max_record_bytes = 4096;

// The path number of the recording's own events.
constexpr std::uint16_t no_path = 0;

struct Record {
  Time time{0};  // microseconds since 1970, UTC
  std::uint16_t path = no_path;
  RecordKind kind = RecordKind::event;
  std::string_view bytes;  // the datagram without a terminator, or the event's words
};

struct RecordedPath {
  std::uint16_t number = 1;
  std::string url;
  std::string name;  // the board's name or id; empty until reported
};

// A device on a path's board, with its description (docs/how-to/described-devices.md).
struct RecordedDevice {
  std::uint16_t path = 1;
  std::string place;  // "bno055@0x28:1"
  std::string description;
};

}  // namespace r4
