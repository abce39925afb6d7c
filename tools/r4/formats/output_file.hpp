// SPDX-License-Identifier: GPL-3.0-or-later
// The file that a conversion makes. It is there as a whole or not at all.
#pragma once

#include <cstdio>
#include <memory>
#include <string>
#include <string_view>

#include "conversion.hpp"

namespace r4::tool {

struct CloseFile {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using FilePointer = std::unique_ptr<std::FILE, CloseFile>;

class OutputFile final : public Output {
 public:
  // Makes it. Throws Error if there is such a file, unless `replace`.
  OutputFile(std::string path, bool replace);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  // Throws Error when the disk is full.
  void write(std::string_view bytes) override;
  // All is written. Throws Error.
  void finish();
  const std::string& path() const { return path_; }

 private:
  [[noreturn]] void fail(int error) const;

  const std::string path_;
  std::string part_;  // its name before that, if it has one
  FilePointer file_;
  bool named_ = false;
  const bool replace_;
};

}  // namespace r4::tool
