// SPDX-License-Identifier: GPL-3.0-or-later
// The files of recordings, written and read. They block while the disk is slow.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "../../transports/file_descriptor.hpp"

namespace r4 {

// A file that a recording goes into.
class RecordingFile {
 public:
  // What others have done to the file since it was opened.
  enum class Fate : std::uint8_t { here, moved, removed, truncated };

  // Opens it, or makes it; a recording that is there goes on at its end. Nobody else records into it meanwhile.
  // Throws Error for what cannot be written, and for a file that holds something else.
  explicit RecordingFile(std::string path);

  // Writes all of it and hands it to the disk. Throws Error; then the file is as it was before.
  void append(std::string_view bytes);

  // moved: another file, or none, has its path.
  Fate fate() const;

  std::uint64_t size() const { return size_; }
  // Its last line has no end.
  bool torn() const { return torn_; }

 private:
  void look_at_what_is_there();

  const std::string path_;
  FileDescriptor file_;
  std::uint64_t size_ = 0;
  bool torn_ = false;
};

// A file that a recording is read from.
class RecordingInput {
 public:
  // "-" is the standard input. Throws Error.
  explicit RecordingInput(const std::string& path);
  // What comes next; empty at the end. Valid until the next call. Throws Error.
  std::string_view read();
  const std::string& name() const { return name_; }

 private:
  const std::string name_;
  FileDescriptor file_;
  std::array<char, 16384> piece_;
};

}  // namespace r4
