// SPDX-License-Identifier: GPL-3.0-or-later
#include "key_file.hpp"

#include <fcntl.h>
#include <sys/random.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <array>
#include <cerrno>
#include <cstring>
#include <functional>
#include <utility>

#include "options.hpp"
#include "r4link/error.hpp"
#include "r4link/options.hpp"

namespace r4::tool {
namespace {

Error system_error(const std::string& path, int error, const std::string& fix) {
  const ErrorKind kind =
      error == EACCES || error == EPERM ? ErrorKind::permission : ErrorKind::open;
  return {kind, path, std::strerror(error), fix};
}

CLI::Option* add_key_option(CLI::App& command, const std::string& help,
                            std::function<void(const std::string&)> take) {
  return command
      .add_option_function<std::string>(
          "--key",
          [take = std::move(take)](const std::string& text) {
            if (text.empty()) {
              throw Error(ErrorKind::usage, "--key", "does not name a file",
                          "write --key FILE, or leave --key out");
            }
            take(text);
          },
          help)
      ->envname("R4_KEY")
      ->type_name(file_type);
}

}  // namespace

void make_key_file(const std::string& path, std::uint8_t id) {
  Key key;
  key.id = id;
  if (::getrandom(key.bytes, sizeof key.bytes, 0) != static_cast<ssize_t>(sizeof key.bytes)) {
    throw Error(ErrorKind::unsupported, "random numbers", std::strerror(errno), "try again");
  }
  std::array<char, key_text_size + 1> text;
  *write_key(text.data(), key) = '\n';
  const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (file < 0) {
    throw system_error(path, errno,
                       errno == EEXIST ? "choose another name, because a key is never overwritten"
                                       : "choose a folder that you may write to");
  }
  const auto written = ::write(file, text.data(), text.size());
  const bool kept = written == static_cast<ssize_t>(text.size()) && ::fsync(file) == 0;
  const int error = written < 0 ? errno : ENOSPC;
  ::close(file);
  if (!kept) {
    ::unlink(path.c_str());
    throw system_error(path, error, "free some disk space, then try again");
  }
}

CLI::Option* add_key(CLI::App& command, std::string& path) {
  return add_key_option(command, "the board's key, in a file made by r4 key new (default: $R4_KEY)",
                        [&path](const std::string& text) { path = text; });
}

CLI::Option* add_keys(CLI::App& command, std::vector<std::string>& paths) {
  return add_key_option(command, "a key file of the board (default: $R4_KEY); may be repeated",
                        [&paths](const std::string& text) { paths.push_back(text); })
      ->trigger_on_parse()
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeLast);
}

BoardOptions with_key(const std::string& path, BoardOptions options) {
  if (!path.empty()) options.session.key = load_key(path);
  return options;
}

}  // namespace r4::tool
