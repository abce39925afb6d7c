// SPDX-License-Identifier: GPL-3.0-or-later
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <thread>
#include <utility>

#include "../shell/json.hpp"
#include "../shell/options.hpp"
#include "../shell/output.hpp"
#include "../shell/subcommands.hpp"
#include "dfu_util.hpp"
#include "r4link/board.hpp"
#include "r4link/discovery/discover.hpp"
#include "r4link/discovery/url.hpp"
#include "r4link/error.hpp"

namespace r4::tool {
namespace {

using Clock = std::chrono::steady_clock;

struct UploadOptions {
  std::string file;
  std::string url = "serial:auto";
  Milliseconds timeout{20000};
  bool json = false;
};

std::uint32_t word(const std::array<unsigned char, 8>& bytes, std::size_t at) {
  return bytes[at] | bytes[at + 1] << 8U | bytes[at + 2] << 16U |
         static_cast<std::uint32_t>(bytes[at + 3]) << 24U;
}

// A sketch for the Giga's M7 begins with the top of its stack and its first instruction.
void check_image(const std::string& path) {
  constexpr std::uint32_t flash = 0x08040000;
  constexpr std::uint32_t flash_size = 1966080;  // from boards.txt of the core
  const auto refuse = [&](const std::string& reason) {
    throw Error(
        ErrorKind::data, path, reason,
        "give the .bin file of Sketch > Export Compiled Binary, for the board Arduino Giga R1");
  };
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  if (!file) throw Error(ErrorKind::open, path, std::strerror(errno), "check the file name");
  const std::streamoff size = file.tellg();
  std::array<unsigned char, 8> begin{};
  file.seekg(0);
  if (size <= 0 || !file.read(reinterpret_cast<char*>(begin.data()), begin.size())) {
    refuse("it is not a compiled sketch: it is too short");
  }
  if (size > flash_size) {
    refuse(
        fmt::format("it is too large: {} bytes, but the Giga has room for {}", size, flash_size));
  }
  const std::uint32_t stack = word(begin, 0);
  const std::uint32_t start = word(begin, 4);
  const bool in_ram =
      (stack > 0x20000000 && stack <= 0x20020000) || (stack > 0x24000000 && stack <= 0x24080000);
  if (!in_ram || start % 2 == 0 || start < flash || start >= flash + flash_size) {
    refuse("it is not a sketch for the Giga's M7 core");
  }
}

// The port of `url`. Empty if any board is accepted (serial:auto) and no board runs.
std::optional<std::string> port_of(const std::string& url) {
  const Url parsed = Url::parse(url);
  if (parsed.scheme() != "serial") {
    throw Error(ErrorKind::usage, url, "a sketch can be written only over the board's USB cable",
                "give serial:auto, serial:?sn=... or serial:///dev/ttyACM0");
  }
  if (!parsed.path().empty() && parsed.path() != "auto") return parsed.path();
  const Discovery found = discover({.can = false, .udp = false});
  const std::optional<std::string> number = parsed.get("sn");
  std::optional<std::string> path;
  for (const SearchedPort& port : found.ports) {
    if (!port.is_r4 || (number && port.serial_number != *number)) continue;
    if (path) {
      throw Error(ErrorKind::usage, url, fmt::format("{} and {} are boards", *path, port.path),
                  "name one board by its serial number, which r4 list shows");
    }
    path = port.path;
  }
  if (number && !path) {
    throw Error(ErrorKind::open, url, "no board with this serial number runs at USB",
                "plug the board in; if it waits in its boot loader, give serial:auto");
  }
  return path;
}

class Port {
 public:
  explicit Port(std::string path)
      : path_(std::move(path)),
        number_(::open(path_.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC)) {
    const int error = number_ < 0 ? errno : 0;
    const bool denied = error == EACCES || error == EPERM;
    if (error != 0 && error != EBUSY) {
      throw Error(denied ? ErrorKind::permission : ErrorKind::open, path_, std::strerror(error),
                  "run r4 doctor serial:auto");
    }
    if (error == EBUSY || ::flock(number_, LOCK_EX | LOCK_NB) != 0) {
      close();
      throw Error(ErrorKind::open, path_, "another program uses the port",
                  "close that program: r4 list shows its name");
    }
  }
  ~Port() { close(); }
  Port(const Port&) = delete;
  Port& operator=(const Port&) = delete;

  // 1200 baud: the firmware switches its outputs off and waits for the port to close.
  void ask_for_upload() const {
    constexpr std::chrono::milliseconds held{400};  // the core resets after 200 ms at the earliest
    termios settings{};
    const bool set = ::tcgetattr(number_, &settings) == 0 && ::cfsetspeed(&settings, B1200) == 0 &&
                     (::cfmakeraw(&settings), ::tcsetattr(number_, TCSANOW, &settings)) == 0;
    if (!set) {
      throw Error(ErrorKind::open, path_, std::strerror(errno), "unplug the board and plug it in");
    }
    const int ready = TIOCM_DTR;
    ::ioctl(number_, TIOCMBIS, &ready);  // a pseudo-terminal has no such line
    std::this_thread::sleep_for(held);
    ::ioctl(number_, TIOCMBIC, &ready);  // even if a program has set the port to keep the line
  }
  // The USB path of the port's device, as dfu-util names it: "1-2". Empty: no USB port.
  std::string usb_path() const {
    std::error_code ignored;
    // path_ may be a symbolic link
    const auto device = std::filesystem::canonical(path_, ignored);
    const auto name = device.filename();
    auto folder = std::filesystem::canonical("/sys/class/tty" / name / "device", ignored);
    while (folder.has_relative_path() && !std::filesystem::exists(folder / "idVendor")) {
      folder = folder.parent_path();
    }
    return folder.filename().string();
  }

 private:
  void close() {
    if (number_ >= 0) ::close(number_);
    number_ = -1;
  }
  std::string path_;
  int number_;
};

void report(const UploadOptions& options, const Json& object, const std::string& text) {
  if (options.json) {
    print_line(object);
  } else {
    print_text("{}\n", text);
  }
}

// Throws if a board with R4 firmware does not confirm the stop. Other firmware does not answer.
void switch_off(const UploadOptions& options) {
  Board board(options.url);
  try {
    board.identify();
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::refused) throw;
    return report(options, {{"type", "silent"}},
                  "R4 firmware does not answer, so r4 cannot switch outputs off");
  }
  board.stop();
  report(options, {{"type", "stopped"}}, "the board reports that its outputs are off");
}

// The USB path of the boot loader to write: `usb_path`, or if empty, the only boot loader.
std::string wait_for_boot_loader(const std::string& usb_path, Clock::time_point deadline) {
  constexpr std::chrono::milliseconds pause{200};
  for (;;) {
    const auto [usb_paths, denied] = look_for_boot_loaders();
    if (std::find(usb_paths.begin(), usb_paths.end(), usb_path) != usb_paths.end()) return usb_path;
    if (usb_path.empty() && usb_paths.size() == 1) return usb_paths.front();
    if (usb_path.empty() && usb_paths.size() > 1) {
      throw Error(ErrorKind::usage, "the boot loader", "two or more boards wait in it",
                  "unplug all boards except one");
    }
    if (denied) {
      throw Error(ErrorKind::permission, "the boot loader (USB 2341:0366)", "permission denied",
                  "install the udev rules, which r4 doctor --udev-rules prints, or run r4 as root");
    }
    if (Clock::now() >= deadline) {
      throw Error(ErrorKind::open, "the boot loader (USB 2341:0366)", "it was not found",
                  "press the board's reset button twice, until its green light pulses, and repeat");
    }
    std::this_thread::sleep_for(pause);
  }
}

void write(const UploadOptions& options, const std::string& usb_path) {
  const bool bar = !options.json && ::isatty(STDOUT_FILENO) == 1;
  write_by_dfu(options.file, usb_path, [&](int percent) {
    if (options.json) {
      print_line({{"type", "progress"}, {"percent", percent}});
    } else if (bar) {
      print_raw(fmt::format("\r[{:<50}] {:3} %",
                            std::string(static_cast<std::size_t>(percent / 2), '='), percent));
    }
  });
  if (bar) print_raw("\n");
  report(options, {{"type", "written"}, {"file", options.file}},
         fmt::format("{} is written", options.file));
}

void wait_for_board(const UploadOptions& options, Clock::time_point deadline) {
  constexpr std::chrono::milliseconds pause{200};
  BoardOptions watching;
  watching.role = BoardRole::watch;
  for (;;) {
    try {
      Board board(options.url, watching);
      const BoardIdentity identity = board.identify();
      return report(
          options,
          {{"type", "identity"}, {"firmware", identity.firmware}, {"id", identity.board_id}},
          fmt::format("the board runs firmware {}, id {}", identity.firmware, identity.board_id));
    } catch (const Error&) {
      if (Clock::now() >= deadline) break;
    }
    std::this_thread::sleep_for(pause);
  }
  throw Error(ErrorKind::refused, options.url,
              "the sketch is written, but R4 firmware does not answer",
              "check that the sketch is R4Board, and run r4 doctor");
}

int upload(const UploadOptions& options) {
  check_image(options.file);
  const std::optional<std::string> port = port_of(options.url);
  // First, because a port that cannot be opened must be an error before the board is stopped.
  const std::string usb_path = port ? Port(*port).usb_path() : std::string();
  const BootLoaders waiting = look_for_boot_loaders();
  const bool waits = waiting.denied || !waiting.usb_paths.empty();
  if (port && usb_path.empty() && waits) {
    throw Error(
        ErrorKind::usage, "the boot loader", "another board waits in it",
        fmt::format("unplug one board: the board in the boot loader, or the board at {}", *port));
  }
  if (!port && !waits) {
    throw Error(ErrorKind::open, options.url, "no board was found at USB",
                "plug a board in, or press its reset button twice, until its green light pulses");
  }
  if (port) {
    switch_off(options);
    Port(*port).ask_for_upload();
  }
  write(options, wait_for_boot_loader(usb_path, Clock::now() + options.timeout));
  wait_for_board(options, Clock::now() + options.timeout);
  return 0;
}

constexpr const char* upload_footer =
    R"(FILE is the file that the Arduino IDE makes by Sketch > Export Compiled Binary. r4 stops the board, starts
its boot loader (1200 baud), writes the sketch with dfu-util, and waits until the board reports its
version. With serial:auto, if no running board is at USB, r4 writes at once to the board that waits in its
boot loader (press the reset button twice). Ctrl-C does not end a write that has begun. Keep the wheels off
the ground: a sketch that is not R4's may drive outputs.

Examples:
  r4 upload R4Board.ino.bin
  r4 upload R4Board.ino.bin serial:///dev/ttyACM0

Exit codes: 0 the board runs the sketch; 1 the file is not a sketch for the Giga; 2 usage, or the URL is
not a cable; 3 the board did not confirm the stop, or the sketch is written, but R4 firmware does not
answer; 4 no board, no boot loader, or dfu-util failed; 5 permission denied; 6 dfu-util is not installed.)";

}  // namespace

void add_upload(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<UploadOptions>();
  CLI::App* const command = add_subcommand(
      root, chosen, "upload", "Put a compiled sketch onto a board", upload_footer, options, upload);
  add_text(*command, "FILE", options->file, "the compiled sketch, a .bin file", file_type,
           Need::required);
  add_text(*command, "URL", options->url, "where the board is (default serial:auto)", url_type);
  add_seconds(*command, "--timeout", options->timeout,
              "how long to wait for the boot loader, then for the board (default 20)");
  add_json(*command, options->json, "print JSON");
}

}  // namespace r4::tool
