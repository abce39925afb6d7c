// SPDX-License-Identifier: GPL-3.0-or-later
// Writes and reads recordings. Calls block while the disk is slow.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "../../transports/file_descriptor.hpp"

namespace r4 {

class RecordingFile {
 public:
  // Changes by another program since the file was opened.
  enum class Fate : std::uint8_t { here, moved, removed, truncated };

  // Opens or creates the file and locks it against other programs. Continues an existing
  // recording. Throws Error for a file that cannot be written or is not a recording.
  explicit RecordingFile(std::string path);

  // Writes all bytes to the disk. If that fails, removes an incomplete write and throws Error.
  void append(std::string_view bytes);

  // moved: the path leads to another file or to no file.
  Fate fate() const;

  std::uint64_t size() const { return size_; }
  // True if the last line had no end when the file was opened.
  bool torn() const { return torn_; }

 private:
  void look_at_what_is_there();

  const std::string path_;
  FileDescriptor file_;
  std::uint64_t size_ = 0;
  bool torn_ = false;
};

class RecordingInput {
 public:
  // "-" is the standard input. Throws Error.
  explicit RecordingInput(const std::string& path);
  // The next bytes, valid until the next call; empty at the end. Throws Error.
  std::string_view read();

 private:
  const std::string name_;
  FileDescriptor file_;
  std::array<char, 16384> piece_;
};

}  // namespace r4
