// SPDX-License-Identifier: GPL-3.0-or-later
// The file appears complete or not at all.
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
  // Throws Error if the file exists and `replace` is false.
  OutputFile(std::string path, bool replace);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  // Throws Error, for example if the disk is full.
  void write(std::string_view bytes) override;
  // Completes the file and gives it its name. Throws Error.
  void finish();
  const std::string& path() const { return path_; }

 private:
  [[noreturn]] void fail(int error) const;

  const std::string path_;
  std::string part_;  // temporary name, if O_TMPFILE is not supported
  FilePointer file_;
  bool named_ = false;
  const bool replace_;
};

}  // namespace r4::tool
