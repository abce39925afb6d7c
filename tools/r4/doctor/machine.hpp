// SPDX-License-Identifier: GPL-3.0-or-later
// What r4 doctor reads of a machine: its files below a root, who asks, and what programs say. A test makes up all three.
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
  std::set<gid_t> groups;  // that this process has
  bool is_root() const { return id == 0; }
};
User this_user();

// The command for a shell, with / as its working directory: a PATH with "." or an empty entry then leads to no file that
// happens to lie where r4 was started.
std::string from_root(const std::string& command);

struct Machine {
  std::string root;  // before every path; empty: this machine
  User user;
  // What the command says on its standard output; empty if there is no such program or it fails.
  std::function<std::string(const std::string& command)> run;

  static Machine here();

  // The text of a file without the end of its last line; none if it cannot be read.
  std::optional<std::string> read(const std::string& path) const;
  bool exists(const std::string& path) const;
  // The names in a directory, sorted.
  std::vector<std::string> list(const std::string& path) const;
  // Where a symbolic link leads to, as it is written there.
  std::optional<std::string> link(const std::string& path) const;
  // The command, so that root runs it.
  std::string as_root(const std::string& command) const;
};

}  // namespace r4::tool
