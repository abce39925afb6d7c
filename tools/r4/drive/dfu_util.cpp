// SPDX-License-Identifier: GPL-3.0-or-later
#include "dfu_util.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <string_view>
#include <vector>

#include "r4link/error.hpp"

namespace r4::tool {
namespace {

constexpr const char* boot_loader_id = "2341:0366";  // USB vendor and product
constexpr const char* sketch_address =
    "0x08040000:leave";  // then the boot loader starts the sketch

struct Pipe {
  Pipe() {
    if (::pipe2(ends.data(), O_CLOEXEC) != 0) {
      throw Error(ErrorKind::open, "a pipe", std::strerror(errno), "close some programs");
    }
  }
  ~Pipe() {
    for (const int end : ends) ::close(end);
  }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;
  std::array<int, 2> ends{};
};

int run_dfu_util(std::vector<const char*> arguments,
                 const std::function<void(std::string_view)>& on_text) {
  arguments.insert(arguments.begin(), "dfu-util");
  arguments.push_back(nullptr);
  Pipe pipe;
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, pipe.ends[1], STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, pipe.ends[1], STDERR_FILENO);
  // An interrupted write leaves half a sketch: Ctrl-C or the end of r4 must not end dfu-util.
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  const auto on_broken_pipe = std::signal(SIGPIPE, SIG_IGN);
  pid_t pid = 0;
  const int error = ::posix_spawnp(&pid, "dfu-util", &actions, &attributes,
                                   const_cast<char* const*>(arguments.data()), environ);
  std::signal(SIGPIPE, on_broken_pipe);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) {
    throw Error(ErrorKind::unsupported, "dfu-util",
                "cannot be started, but r4 needs it to write the sketch",
                "install it as root: apt-get install dfu-util");
  }
  ::close(pipe.ends[1]);
  pipe.ends[1] = -1;
  std::array<char, 4096> buffer{};
  for (;;) {
    const ssize_t size = ::read(pipe.ends[0], buffer.data(), buffer.size());
    if (size < 0 && errno == EINTR) continue;
    if (size <= 0) break;
    on_text({buffer.data(), static_cast<std::size_t>(size)});
  }
  int status = 0;
  while (::waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : 1;
}

// The bar "Download	[=====     ]  20%        24576 bytes" follows a bar "Erase".
class Progress {
 public:
  explicit Progress(const std::function<void(int)>& on_percent) : on_percent_(on_percent) {}
  void take(std::string_view text) {
    constexpr std::string_view title = "Download";
    for (const char c : text) {
      if (matched_ < title.size()) {
        matched_ = c == title[matched_] ? matched_ + 1 : c == title[0] ? 1 : 0;
        continue;
      }
      if (c >= '0' && c <= '9') {
        number_ = std::min(number_ * 10 + (c - '0'), 1000);
        continue;
      }
      if (c == '%' && number_ <= 100 && number_ > told_) on_percent_(told_ = number_);
      number_ = 0;
    }
  }

 private:
  const std::function<void(int)>& on_percent_;
  std::size_t matched_ = 0;  // characters of the bar's title
  int number_ = 0;
  int told_ = -1;
};

std::string last_line(std::string_view text) {
  const auto end = text.find_last_not_of("\r\n \t");
  if (end == std::string_view::npos) return "failed without a message";
  text = text.substr(0, end + 1);
  const auto begin = text.find_last_of("\r\n");
  if (begin != std::string_view::npos) text.remove_prefix(begin + 1);
  constexpr std::string_view own_name = "dfu-util: ";
  if (text.starts_with(own_name)) text.remove_prefix(own_name.size());
  return std::string(text);
}

}  // namespace

BootLoaders look_for_boot_loaders() {
  std::string text;
  run_dfu_util({"-l", "-d", boot_loader_id}, [&](std::string_view part) { text += part; });
  BootLoaders found;
  found.denied = text.find("LIBUSB_ERROR_ACCESS") != std::string::npos ||
                 text.find("Cannot open DFU device 2341:0366") != std::string::npos;
  // dfu-util prints a line for each memory of a boot loader. Each board has one path.
  std::vector<std::string>& paths = found.usb_paths;
  for (std::size_t at = text.find("Found DFU: [2341:0366]"); at != std::string::npos;
       at = text.find("Found DFU: [2341:0366]", at + 1)) {
    const std::string line = text.substr(at, text.find('\n', at) - at);
    const auto path = line.find("path=\"");
    const std::string where = path == std::string::npos
                                  ? std::string()
                                  : line.substr(path + 6, line.find('"', path + 6) - path - 6);
    if (std::find(paths.begin(), paths.end(), where) == paths.end()) paths.push_back(where);
  }
  return found;
}

void write_by_dfu(const std::string& path, const std::string& usb_path,
                  const std::function<void(int)>& on_percent) {
  constexpr std::size_t most_kept = 4096;
  std::string end;
  Progress progress(on_percent);
  const int code = run_dfu_util({"-d", boot_loader_id, "-p", usb_path.c_str(), "-a", "0", "-s",
                                 sketch_address, "-D", path.c_str()},
                                [&](std::string_view part) {
                                  progress.take(part);
                                  end += part;
                                  if (end.size() > most_kept) end.erase(0, end.size() - most_kept);
                                });
  // Some versions of dfu-util report an error if the board starts the sketch without an answer.
  const bool written = end.find("File downloaded successfully") != std::string::npos;
  if (code != 0 && !written) {
    throw Error(ErrorKind::open, "dfu-util", last_line(end),
                "press the board's reset button twice to start its boot loader, and try again");
  }
}

}  // namespace r4::tool
