// SPDX-License-Identifier: GPL-3.0-or-later
// The receiver of a recording's content.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "../config.hpp"
#include "record.hpp"

namespace r4 {

struct RecordingDamage {
  enum class Kind : std::uint8_t {
    line,  // not a line of a recording
    torn,  // the last line has no end: the writing program ended there
    zstd,  // a part of a compressed recording, whose lines are not counted
  };
  Kind kind = Kind::line;
  std::uint64_t line = 1;    // from 1; 0 in a file of a format without lines
  std::uint64_t offset = 0;  // offset of the first byte in the text; for zstd, in the file
  std::string_view reason;
};
// "line 12, byte 480: longer than any line of a recording". `reason` may have bytes of the file.
R4LINK_API std::string to_text(const RecordingDamage& damage);

// Calls are in the order of the file. Arguments are valid within the call.
class RecordingVisitor {
 public:
  virtual ~RecordingVisitor() = default;
  // A datagram, also a damaged datagram, or an event. The path may lack a path line.
  virtual void on_record(const Record& record) = 0;
  // Reading continues after the damage.
  virtual void on_damage(const RecordingDamage& damage) = 0;
  // Usually called before the first record of the path (not in a damaged or foreign file), and
  // again when the path's name is known. After a new header a path number may mean another path.
  virtual void on_path(const RecordedPath& path) { static_cast<void>(path); }
  // A device in a slot of a path, until the next header. Device::parse() reads the device.
  virtual void on_device(const RecordedDevice& device) { static_cast<void>(device); }
  // A recording begins or continues here. One file may hold several recordings.
  virtual void on_header() {}
  // Any # line except path lines. A header or device line is passed too, after on_header() or
  // on_device().
  virtual void on_comment(std::string_view line) { static_cast<void>(line); }
};

}  // namespace r4
