// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <cerrno>
#include <fstream>
#include <string>
#include <system_error>
#include <vector>

#include "r4link/devices/description.hpp"
#include "r4link/error.hpp"
#include "shipped.hpp"

namespace r4 {

namespace {

std::string read_description(const std::string& path) {
  // One byte more than the limit, so that parse() rejects a longer or endless file.
  std::string text(DeviceDescription::max_text + 1, '\0');
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  if (file) file.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (file.bad() || (file.fail() && !file.eof())) {
    const int why = errno == 0 ? EIO : errno;
    throw Error(why == EACCES ? ErrorKind::permission : ErrorKind::open, path,
                std::generic_category().message(why), "name a file that describes a device");
  }
  text.resize(static_cast<std::size_t>(file.gcount()));
  return text;
}

}  // namespace

std::vector<std::string> DeviceDescription::shipped() {
  std::vector<std::string> names;
  for (const ShippedDescription& each : shipped_descriptions) names.emplace_back(each.name);
  return names;
}

std::string_view DeviceDescription::text_of(const std::string& name) {
  for (const ShippedDescription& each : shipped_descriptions) {
    if (each.name == name) return each.text;
  }
  throw Error(ErrorKind::usage, name, "no such device is described here",
              fmt::format("there are {}; a file of your own is named by its path: ./{}.device",
                          fmt::join(shipped(), ", "), name));
}

DeviceDescription DeviceDescription::load(const std::string& name_or_path) {
  const bool is_path = name_or_path.find('/') != std::string::npos ||
                       std::string_view(name_or_path).ends_with(".device");
  if (is_path) return parse(read_description(name_or_path), name_or_path);
  return parse(text_of(name_or_path), name_or_path);
}

}  // namespace r4
