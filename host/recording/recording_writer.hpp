// SPDX-License-Identifier: GPL-3.0-or-later
// Writes records to files. Files with names in .zst are compressed. With limits there are several
// files. Blocks while the disk is slow. Has no clock, and uses the records' times.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "r4link/error.hpp"
#include "r4link/recording.hpp"
#include "r4link/recordings/record.hpp"
#include "r4link/recordings/record_line.hpp"
#include "r4link/recordings/zstd_stream.hpp"
#include "recording_file.hpp"
#include "recording_parts.hpp"

namespace r4 {

class RecordingWriter {
 public:
  // Opens the file. Throws Error.
  RecordingWriter(const std::string& path, const RecordingOptions& options);

  // Call before a path's first record, and again when its name is known.
  void declare(const RecordedPath& path);
  // Declares a device in this and later files. Replaces the device at the same place of the path.
  void declare(const RecordedDevice& device);
  // Appends a record without its secrets. Throws Error if the file cannot be written.
  void append(const Record& record);
  // Writes all appended records to the disk. Throws Error. If another program has moved, removed or
  // truncated the file, starts a new file first.
  void flush();
  void close();  // as flush(), and ends the compressed frame

  const std::string& path() const { return path_; }
  // If the file was restarted since the last call: why. Kind `data`: the content is lost.
  std::optional<Problem> take_trouble() { return std::exchange(trouble_, std::nullopt); }

 private:
  bool is_due(Time time) const;
  void begin_file();
  void look_after_file();
  void write_out(bool end_frame);

  const RecordingOptions options_;
  RecordingParts parts_;
  std::string path_;
  std::optional<RecordingFile> file_;
  std::optional<Problem> trouble_;
  std::optional<ZstdWriter> zstd_;
  std::map<std::uint16_t, RecordedPath> paths_;
  std::vector<RecordedDevice> devices_;
  RecordRoom room_;   // a member to save allocations
  std::string text_;  // not written yet
  std::string compressed_;
  std::size_t frame_ = 0;      // text in the frame so far
  std::optional<Time> begun_;  // time of this file's first record
};

}  // namespace r4
