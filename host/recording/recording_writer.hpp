// SPDX-License-Identifier: GPL-3.0-or-later
// Turns records into files: compressed where their name says so, one after the other where there are limits. Blocks
// while the disk is slow. Knows no clock: time is that of the records.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "r4link/error.hpp"
#include "r4link/recording.hpp"
#include "record.hpp"
#include "record_line.hpp"
#include "recording_file.hpp"
#include "recording_parts.hpp"
#include "zstd_stream.hpp"

namespace r4 {

class RecordingWriter {
 public:
  // Opens the file. Throws Error.
  RecordingWriter(const std::string& path, const RecordingOptions& options);

  // A path, before its first record, or with more that is known of it. Throws as append() does.
  void declare(const RecordedPath& path);
  // A device: in this file, and in those that follow; instead of another at that place of that path.
  void declare(const RecordedDevice& device);
  // Without the secrets in it. Each may write, and throws Error when that cannot be done.
  void append(const Record& record);
  // What was appended is on the disk when this returns. Throws Error. If others have moved, removed or truncated the
  // file, it is begun anew first.
  void flush();
  // The same, and ends what is compressed.
  void close();

  const std::string& path() const { return path_; }
  // That the file was begun anew since the last call, and why. Kind `data`: what was in it is lost.
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
  std::vector<RecordedPath> paths_;
  std::vector<RecordedDevice> devices_;
  RecordRoom room_;            // used again and again
  std::string text_;           // not written yet
  std::string compressed_;     // used again and again
  std::size_t frame_ = 0;      // text in the frame so far
  std::optional<Time> begun_;  // the first record of this file
};

}  // namespace r4
