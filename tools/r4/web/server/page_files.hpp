// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace r4::tool::web {

struct EmbeddedFile {
  std::string_view name;
  std::string_view content;
};
extern const EmbeddedFile* const embedded_files;
extern const int embedded_file_count;

struct PageFile {
  std::string type;
  std::string etag;
  std::string content;
  std::string gzip;
};

using PageFiles = std::map<std::string, PageFile, std::less<>>;
PageFiles page_files();
PageFile page_file(std::string_view name, std::string_view content);
// Empty if not a regular file directly in the folder, or if hidden or too large.
std::optional<PageFile> page_file_in(const std::string& folder, std::string_view path);

}  // namespace r4::tool::web
