// SPDX-License-Identifier: GPL-3.0-or-later
// The files of the page, which the build puts into the program, and how they are served.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace r4::tool::web {

struct EmbeddedFile {
  std::string_view name;  // "index.html"
  std::string_view content;
};
extern const EmbeddedFile* const embedded_files;
extern const int embedded_file_count;

struct PageFile {
  std::string type;  // "text/html; charset=utf-8"
  std::string etag;  // with its quotation marks
  std::string content;
  std::string gzip;
};

// By their path: "/index.html".
using PageFiles = std::map<std::string, PageFile, std::less<>>;
PageFiles page_files();
PageFile page_file(std::string_view name, std::string_view content);
// The regular file of that folder at such a path. None for all else: the folder itself, what is hidden in it, below or
// beside it, and what is larger than a page's file could be.
std::optional<PageFile> page_file_in(const std::string& folder, std::string_view path);

}  // namespace r4::tool::web
