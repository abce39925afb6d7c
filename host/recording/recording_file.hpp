// SPDX-License-Identifier: GPL-3.0-or-later
// Writes and reads the files of recordings. The calls block while the disk is slow.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "../../transports/file_descriptor.hpp"

namespace r4 {

// The file that a recording is written to.
class RecordingFile {
 public:
  // What another program has done to the file since it was opened.
  enum class Fate : std::uint8_t { here, moved, removed, truncated };

  // Opens or creates the file; an existing recording is continued at its end. No other program can
  // record into it until this object is destroyed. Throws Error for a file that cannot be written,
  // or that holds something else.
  explicit RecordingFile(std::string path);

  // Writes all bytes to the disk. If it throws Error, the file is as it was before.
  void append(std::string_view bytes);

  // moved: its path leads to another file, or to none.
  Fate fate() const;

  std::uint64_t size() const { return size_; }
  // True if its last line had no end when it was opened.
  bool torn() const { return torn_; }

 private:
  void look_at_what_is_there();

  const std::string path_;
  FileDescriptor file_;
  std::uint64_t size_ = 0;
  bool torn_ = false;
};

// The file that a recording is read from.
class RecordingInput {
 public:
  // "-" is the standard input. Throws Error.
  explicit RecordingInput(const std::string& path);
  // The next bytes; empty at the end. Valid until the next call. Throws Error.
  std::string_view read();

 private:
  const std::string name_;
  FileDescriptor file_;
  std::array<char, 16384> piece_;
};

}  // namespace r4
