// SPDX-License-Identifier: GPL-3.0-or-later
// The files of the page, which the build puts into the program, and how they are served.
#pragma once

#include <map>
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

}  // namespace r4::tool::web
