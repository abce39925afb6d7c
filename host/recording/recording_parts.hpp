// SPDX-License-Identifier: GPL-3.0-or-later
// The files of a recording with limits: drive-00001.r4log, drive-00002.r4log …
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "r4link/recording.hpp"

namespace r4 {

class RecordingParts {
 public:
  // Makes the path absolute, so that a changed working directory does not matter. Throws
  // Error{usage} for limits that cannot be kept.
  RecordingParts(const std::string& path, RecordingOptions options);

  // The path of the next file: `path` itself if there are no limits.
  std::string next();
  // Removes the oldest files until there is room for another file. Throws Error.
  void make_room();

  // Size limit of one file, given or derived from keep_bytes; 0: no limit.
  std::uint64_t most_bytes() const { return most_bytes_; }

 private:
  struct Part {
    std::uint64_t number;
    std::uint64_t size;
    std::string path;
  };
  std::vector<Part> found() const;  // oldest first

  std::string stem_, ending_;
  RecordingOptions options_;
  std::uint64_t most_bytes_ = 0;
  std::uint64_t number_ = 0;
};

}  // namespace r4
