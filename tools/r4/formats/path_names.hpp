// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <unordered_map>

#include "r4link/recordings/record.hpp"

namespace r4::tool {

class PathNames {
 public:
  void on_path(const RecordedPath& path) {
    Path& known = paths_[path.number];
    if (known.url == path.url && path.name.empty()) return;
    known = {path.url, path.name};
  }
  const std::string& name_of(std::uint16_t number) const { return path_of(number).name; }
  const std::string& url_of(std::uint16_t number) const { return path_of(number).url; }
  const std::string& of(std::uint16_t number) const {
    const Path& path = path_of(number);
    return path.name.empty() ? path.url : path.name;
  }

 private:
  struct Path {
    std::string url, name;
  };
  const Path& path_of(std::uint16_t number) const {
    static const Path none;
    const auto known = paths_.find(number);
    return known == paths_.end() ? none : known->second;
  }
  std::unordered_map<std::uint16_t, Path> paths_;
};

}  // namespace r4::tool
