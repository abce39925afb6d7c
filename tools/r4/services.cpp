// SPDX-License-Identifier: GPL-3.0-or-later
// r4 ros2: Cyclone DDS takes several times as long to load as the rest of r4, and a stop must not
// wait for it. So r4 becomes r4-services, in the same process, which reads the command line again.
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <system_error>
#include <vector>

#include "r4link/error.hpp"
#include "ros2/bridge.hpp"

namespace r4::tool {
namespace {

std::vector<std::string> command_line() {
  std::ifstream file("/proc/self/cmdline", std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  std::vector<std::string> arguments;
  for (std::size_t at = 0; at < text.size(); at += arguments.back().size() + 1) {
    arguments.emplace_back(text.c_str() + at);
  }
  return arguments;
}

[[noreturn]] void become_services() {
  std::vector<std::string> arguments = command_line();
  std::vector<char*> pointers(arguments.size() + 1, nullptr);  // ends with a null pointer
  std::transform(arguments.begin(), arguments.end(), pointers.begin(),
                 [](std::string& each) { return each.data(); });
  std::error_code error;
  const auto folder = std::filesystem::read_symlink("/proc/self/exe", error).parent_path();
  // r4-services is beside r4 in a build, and at R4_SERVICES_FROM_BIN in an installation.
  for (const char* const place : {"r4-services", R4_SERVICES_FROM_BIN}) {
    const std::filesystem::path program = folder / place;
    ::execv(program.c_str(), pointers.data());
    if (errno != ENOENT) {
      throw Error(ErrorKind::permission, program.string(),
                  "cannot be run: " + std::system_category().message(errno),
                  "check its permissions, or install r4 again");
    }
  }
  throw Error(ErrorKind::unsupported, "r4-services",
              "this part of r4 is missing at " + folder.string() + "/r4-services and at " +
                  (folder / R4_SERVICES_FROM_BIN).lexically_normal().string(),
              "install all parts of r4, with cmake --install or as a package");
}

}  // namespace

namespace ros2 {

int run_bridge(const BridgeOptions&) { become_services(); }

}  // namespace ros2

}  // namespace r4::tool
