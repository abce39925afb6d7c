// SPDX-License-Identifier: GPL-3.0-or-later
#include "machine.hpp"

#include <fmt/format.h>
#include <pwd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <system_error>

namespace r4::tool {
namespace {

constexpr std::size_t most_bytes = 1 << 20;

std::string output_of(const std::string& command) {
  const auto close = [](FILE* file) { ::pclose(file); };
  const std::unique_ptr<FILE, decltype(close)> pipe(
      ::popen((from_root(command) + " 2>/dev/null </dev/null").c_str(), "re"), close);
  std::string text;
  std::array<char, 4096> buffer{};
  while (pipe && text.size() < most_bytes) {
    const std::size_t size = std::fread(buffer.data(), 1, buffer.size(), pipe.get());
    if (size == 0) break;
    text.append(buffer.data(), size);
  }
  return text;
}

}  // namespace

User this_user() {
  User user;
  user.id = ::geteuid();
  const passwd* const entry = ::getpwuid(user.id);
  user.name = entry != nullptr ? entry->pw_name : fmt::format("{}", user.id);
  std::vector<gid_t> groups(static_cast<std::size_t>(std::max(0, ::getgroups(0, nullptr))));
  const int count = ::getgroups(static_cast<int>(groups.size()), groups.data());
  if (count > 0) user.groups.insert(groups.begin(), groups.begin() + count);
  user.groups.insert(::getegid());
  return user;
}

std::string from_root(const std::string& command) { return "cd / && " + command; }

Machine Machine::here() { return {"", this_user(), output_of}; }

std::optional<std::string> Machine::read(const std::string& path) const {
  std::ifstream file(root + path, std::ios::binary);
  if (!file) return std::nullopt;
  std::string text(most_bytes, '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (file.bad()) return std::nullopt;
  text.resize(static_cast<std::size_t>(file.gcount()));
  if (text.ends_with('\n')) text.pop_back();
  return text;
}

bool Machine::exists(const std::string& path) const {
  std::error_code error;
  return std::filesystem::exists(root + path, error);
}

std::vector<std::string> Machine::list(const std::string& path) const {
  std::vector<std::string> names;
  std::error_code error;
  std::filesystem::directory_iterator each(root + path, error);
  for (; !error && each != std::filesystem::directory_iterator(); each.increment(error)) {
    names.push_back(each->path().filename().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

std::optional<std::string> Machine::link(const std::string& path) const {
  std::error_code error;
  const std::filesystem::path target = std::filesystem::read_symlink(root + path, error);
  if (error) return std::nullopt;
  return target.string();
}

std::string Machine::as_root(const std::string& command) const {
  if (user.is_root()) return command;
  const bool simple = command.find_first_of("|&;<>*") == std::string::npos;
  return simple ? "sudo " + command : fmt::format("sudo sh -c '{}'", command);
}

}  // namespace r4::tool
