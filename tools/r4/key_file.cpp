// SPDX-License-Identifier: GPL-3.0-or-later
#include "key_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <string_view>

#include "options.hpp"
#include "transports/error.hpp"
#include "transports/file_descriptor.hpp"

namespace r4::tool {
namespace {

constexpr const char* new_one = "make one: r4 key new FILE";

Error system_error(const std::string& path, int error, const std::string& fix) {
  const ErrorKind kind =
      error == EACCES || error == EPERM ? ErrorKind::permission : ErrorKind::open;
  return {kind, path, std::strerror(error), fix};
}

Error cannot_be_read(const std::string& path, int error) {
  std::string fix = new_one;
  if (error == EACCES || error == EPERM) {
    fix = "run r4 as the user whose key it is, or make one of your own: r4 key new FILE";
  } else if (path.starts_with("~/")) {
    fix = "the shell left the ~ as it is: write $HOME" + path.substr(1);
  }
  return system_error(path, error, fix);
}

// What is in it, up to a little more than a key is long.
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

Key read_key_file(const std::string& path) {
  const FileDescriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  struct stat status {};
  if (!file || ::fstat(file.get(), &status) != 0) throw cannot_be_read(path, errno);
  if (S_ISDIR(status.st_mode)) {
    throw Error(ErrorKind::open, path, "is a directory", "name the file that holds the key");
  }
  if ((status.st_mode & (S_IRWXG | S_IRWXO)) != 0) {
    throw Error(ErrorKind::permission, path, "others can read or write this key",
                "chmod 600 " + path + "; if somebody may have read it, make a new one");
  }
  std::string text = contents(file, path);
  text.erase(text.find_last_not_of("\r\n") + 1);
  Key key;
  if (parse_key(Text(text), key) != Refusal::none) {
    throw Error(
        ErrorKind::data, path, "holds no key",
        fmt::format("a key is one line, an id of 1 to {}, a colon and {} hexadecimal digits; {}",
                    max_key_id, 2 * key_size, new_one));
  }
  return key;
}

void make_key_file(const std::string& path, std::uint8_t id) {
  Key key;
  key.id = id;
  if (::getrandom(key.bytes, sizeof key.bytes, 0) != static_cast<ssize_t>(sizeof key.bytes)) {
    throw Error(ErrorKind::unsupported, "random numbers", std::strerror(errno), "try again");
  }
  std::array<char, key_text_size + 1> text;
  *write_key(text.data(), key) = '\n';
  const FileDescriptor file(::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
  if (!file) {
    throw system_error(path, errno,
                       errno == EEXIST ? "choose another name; a key is never overwritten"
                                       : "choose a place that can be written");
  }
  const auto written = ::write(file.get(), text.data(), text.size());
  if (written != static_cast<ssize_t>(text.size()) || ::fsync(file.get()) != 0) {
    const int error = written < 0 ? errno : ENOSPC;
    ::unlink(path.c_str());
    throw system_error(path, error, "make room, then again");
  }
}

CLI::Option* add_key(CLI::App& command, std::string& path) {
  return command
      .add_option_function<std::string>(
          "--key",
          [&path](const std::string& text) {
            if (text.empty()) {
              throw Error(ErrorKind::usage, "--key", "names no file",
                          "write --key FILE, or leave it out");
            }
            path = text;
          },
          "the board's key, in a file made by r4 key new (default: $R4_KEY)")
      ->envname("R4_KEY")
      ->type_name(file_type);
}

BoardOptions with_key(const std::string& path, BoardOptions options) {
  if (!path.empty()) options.session.key = read_key_file(path);
  return options;
}

}  // namespace r4::tool
