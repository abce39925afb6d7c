// SPDX-License-Identifier: GPL-3.0-or-later
// Writes and reads the lines of a recording.
//     # r4log 1 by r4 0.1.0
//     # path 1 serial:///dev/ttyACM0 left-arm
//     # device 1 bno055@0x28:1 name bno055\x0atitle…
//     # from 2026-11-23T21:11:33.404765Z
//     1795468293.404765 1< AIN24:24.28;PNum:7434;T:79090;^0xf07cfd9a^
//
// Lossless: a backslash and a byte that is not printable ASCII are written as \xNN.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "../config.hpp"
#include "../messages/message.hpp"
#include "record.hpp"

namespace r4 {

constexpr std::uint32_t record_version = 1;
// The longest line without its end: a time, a path, and every byte escaped.
constexpr std::size_t max_record_line = 4 * max_record_bytes + 64;

// The record without secrets in its datagram or in the datagram of an event `oversize`. The result
// has at most max_record_bytes, and may be a view of `room`.
using RecordRoom = std::array<char, max_record_bytes + masking_room>;
R4LINK_API Record without_secrets(Record record, RecordRoom& room);

// --- writing; each appends one line with its end

R4LINK_API void write_record_header(std::string& out);
// A comment for people with the time of the first record.
R4LINK_API void write_beginning(std::string& out, Time time);
R4LINK_API void write_path(std::string& out, const RecordedPath& path);
// At most max_record_bytes of description.
R4LINK_API void write_device(std::string& out, const RecordedDevice& device);
// Writes at most max_record_bytes of the record. Times are limited to the years 1970 to 9999.
R4LINK_API void write_record(std::string& out, const Record& record);

// --- reading

enum class LineKind : std::uint8_t {
  damaged,  // not a line of a recording, because of `problem`
  record,
  header,
  path,
  device,
  comment,  // any other line that begins with #
};

// One line. Reuse the object for every line, so that reading allocates nothing.
struct RecordLine {
  LineKind kind = LineKind::damaged;
  const char* problem = "";
  Record record;  // a view of `text`
  RecordedPath path;
  RecordedDevice device;
  std::uint32_t version = 0;
  std::string text;
};

// Reads a line without its end. False if the line is damaged.
R4LINK_API bool read_record_line(std::string_view line, RecordLine& out);

// --- bytes and times, as a line has them

// Appends bytes; writes a backslash and a byte that is not printable ASCII as \xNN.
R4LINK_API void append_escaped(std::string& out, std::string_view bytes);
// The inverse of append_escaped(). False if the text has another form.
R4LINK_API bool append_unescaped(std::string& out, std::string_view text);

// "2026-11-23T21:11:33.404765Z"
R4LINK_API std::string record_time_text(Time time);
// The inverse of record_time_text(), also for fewer decimals and without the Z. Empty if invalid.
R4LINK_API std::optional<Time> read_record_time(std::string_view text);

}  // namespace r4
