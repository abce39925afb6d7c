// SPDX-License-Identifier: GPL-3.0-or-later
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "../transports/file_descriptor.hpp"
#include "r4link/error.hpp"
#include "r4link/options.hpp"

namespace r4 {
namespace {

constexpr const char* new_one = "make a key: r4 key new FILE";

Error cannot_be_read(const std::string& path, int error) {
  const bool denied = error == EACCES || error == EPERM;
  std::string fix = new_one;
  if (denied) {
    fix = "run this as the owner of the key, or make your own key: r4 key new FILE";
  } else if (path.starts_with("~/")) {
    fix = "write $HOME" + path.substr(1) + " or the full path, because only the shell replaces ~";
  }
  return {denied ? ErrorKind::permission : ErrorKind::open, path, std::strerror(error), fix};
}

std::string contents(const FileDescriptor& file, const std::string& path) {
  std::array<char, 2 * key_text_size> buffer;
  std::string text;
  while (text.size() < buffer.size()) {
    const ssize_t n = ::read(file.get(), buffer.data(), buffer.size());
    if (n < 0) throw cannot_be_read(path, errno);
    if (n == 0) break;
    text.append(buffer.data(), static_cast<std::size_t>(n));
  }
  return text;
}

}  // namespace

Key load_key(const std::string& path) {
  const FileDescriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  struct stat status {};
  if (!file || ::fstat(file.get(), &status) != 0) throw cannot_be_read(path, errno);
  if (S_ISDIR(status.st_mode)) {
    throw Error(ErrorKind::open, path, "is a directory", "give the file that holds the key");
  }
  // A group may read a file of root, as with systemd's credentials of a service.
  const mode_t allowed = status.st_uid == 0 ? S_IRWXU | S_IRGRP : S_IRWXU;
  if ((status.st_mode & (S_IRWXU | S_IRWXG | S_IRWXO) & ~allowed) != 0) {
    throw Error(ErrorKind::permission, path, "other users can read or write this key",
                "chmod 600 " + path + "; if another user may have read the key, make a new key");
  }
  std::string text = contents(file, path);
  text.erase(text.find_last_not_of("\r\n") + 1);
  Key key;
  if (parse_key(Text(text), key) != Refusal::none) {
    throw Error(
        ErrorKind::data, path, "does not hold a key",
        fmt::format(
            "give a file of one line: an id of 1 to {}, a colon and {} hexadecimal digits; or {}",
            max_key_id, 2 * key_size, new_one));
  }
  return key;
}

}  // namespace r4
