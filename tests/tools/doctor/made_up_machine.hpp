// SPDX-License-Identifier: GPL-3.0-or-later
// A simulated machine for the checks of r4 doctor: files in a temporary directory.
#pragma once

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>

#include "tools/r4/doctor/finding.hpp"
#include "tools/r4/doctor/machine.hpp"

namespace r4::tool {

class MadeUpMachine {
 public:
  MadeUpMachine() {
    std::string name = (std::filesystem::temp_directory_path() / "r4-doctor-XXXXXX").string();
    machine.root = ::mkdtemp(name.data());
    machine.user = {"mara", 4242, {4242}};
    machine.run = [this](const std::string& line) { return says[line]; };
  }
  ~MadeUpMachine() { std::filesystem::remove_all(machine.root); }
  MadeUpMachine(const MadeUpMachine&) = delete;
  MadeUpMachine& operator=(const MadeUpMachine&) = delete;

  void file(const std::string& path, const std::string& text = "") const {
    const std::filesystem::path where = machine.root + path;
    std::filesystem::create_directories(where.parent_path());
    std::ofstream(where) << text;
  }
  void mode(const std::string& path, unsigned bits) const {
    std::filesystem::permissions(machine.root + path, static_cast<std::filesystem::perms>(bits));
  }
  void link(const std::string& path, const std::string& target) const {
    const std::filesystem::path where = machine.root + path;
    std::filesystem::create_directories(where.parent_path());
    std::filesystem::create_symlink(target, where);
  }

  Machine machine;
  std::map<std::string, std::string> says;  // the output of each command
};

// The finding of this check. Empty if there is no finding.
inline Finding found_by(const Findings& findings, const std::string& check) {
  for (const Finding& each : findings) {
    if (each.check == check) return each;
  }
  return {};
}

}  // namespace r4::tool
