// SPDX-License-Identifier: GPL-3.0-or-later
// The machine for r4 doctor: files below a root, user, output of programs. Tests replace them.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace r4::tool {

struct User {
  std::string name;
  uid_t id = 0;
  std::set<gid_t> groups;
  bool is_root() const { return id == 0; }
};
User this_user();

// Makes `command` run in /, so that a "." in PATH finds no program in the user's folder.
std::string from_root(const std::string& command);

struct Machine {
  std::string root;  // prefix of every path; empty: this machine
  User user;
  // Standard output of the command; empty if the program is missing or fails.
  std::function<std::string(const std::string& command)> run;

  static Machine here();

  // The file's text without the last line end; empty if it cannot be read.
  std::optional<std::string> read(const std::string& path) const;
  bool exists(const std::string& path) const;
  std::vector<std::string> list(const std::string& path) const;
  std::optional<std::string> link(const std::string& path) const;
  std::string as_root(const std::string& command) const;
};

}  // namespace r4::tool
