// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <string>
#include <vector>

#include "../text_file.hpp"
#include "r4link/devices/description.hpp"
#include "r4link/error.hpp"
#include "shipped.hpp"

namespace r4 {

std::vector<std::string> DeviceDescription::shipped() {
  std::vector<std::string> names;
  for (const ShippedDescription& each : shipped_descriptions) names.emplace_back(each.name);
  return names;
}

std::string_view DeviceDescription::text_of(const std::string& name) {
  for (const ShippedDescription& each : shipped_descriptions) {
    if (each.name == name) return each.text;
  }
  throw Error(ErrorKind::usage, name, "a description of this device does not exist",
              fmt::format("use one of {}; or give the path of your own file: ./{}.device",
                          fmt::join(shipped(), ", "), name));
}

DeviceDescription DeviceDescription::load(const std::string& name_or_path) {
  const bool is_path = name_or_path.find('/') != std::string::npos ||
                       std::string_view(name_or_path).ends_with(".device");
  if (is_path) {
    return parse(read_text_file(name_or_path, max_text, "name a file that describes a device"),
                 name_or_path);
  }
  return parse(text_of(name_or_path), name_or_path);
}

}  // namespace r4
