// SPDX-License-Identifier: GPL-3.0-or-later
#include "udp_port_user.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <vector>

namespace r4 {
namespace {

namespace fs = std::filesystem;

// "socket:[1234]", as the descriptors of those sockets are shown.
std::vector<std::string> sockets_of(std::uint16_t port) {
  std::vector<std::string> sockets;
  const std::string end = fmt::format(":{:04X}", port);
  for (const char* const table : {"/proc/self/net/udp", "/proc/self/net/udp6"}) {
    std::ifstream lines(table);
    for (std::string line; std::getline(lines, line);) {
      std::istringstream words(line);
      std::string number, local, word, inode;
      words >> number >> local;
      for (int i = 0; i < 7; ++i) words >> word;  // remote … timeout
      words >> inode;
      if (words && local.ends_with(end)) sockets.push_back("socket:[" + inode + "]");
    }
  }
  return sockets;
}

bool has_one_of(const fs::path& process, const std::vector<std::string>& sockets) {
  std::error_code error;
  for (fs::directory_iterator each(process / "fd", error), end; !error && each != end;
       each.increment(error)) {
    std::error_code gone;
    const std::string target = fs::read_symlink(each->path(), gone).string();
    if (std::find(sockets.begin(), sockets.end(), target) != sockets.end()) return true;
  }
  return false;
}

}  // namespace

std::string user_of_udp_port(std::uint16_t port) {
  const std::vector<std::string> sockets = sockets_of(port);
  std::error_code error;
  for (fs::directory_iterator each("/proc", error), end; !error && each != end;
       each.increment(error)) {
    const std::string pid = each->path().filename().string();
    if (std::isdigit(static_cast<unsigned char>(pid[0])) == 0) continue;
    if (!has_one_of(each->path(), sockets)) continue;
    std::string name;
    std::ifstream comm(each->path() / "comm");
    if (std::getline(comm, name)) return fmt::format("{} (pid {})", name, pid);
  }
  return "another program";
}

}  // namespace r4
