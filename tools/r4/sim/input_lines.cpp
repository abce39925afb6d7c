// SPDX-License-Identifier: GPL-3.0-or-later
#include "input_lines.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <asio/read_until.hpp>
#include <cerrno>
#include <cstring>
#include <istream>
#include <utility>

#include "transports/file_descriptor.hpp"

namespace r4::tool {
namespace {

constexpr std::size_t longest_line = 4096;

// Reopens the input, so that it is non-blocking for this program only. A socket cannot be reopened.
int open_input() {
  const int own = ::open("/proc/self/fd/0", O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  return own >= 0 ? own : ::fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, 3);
}

}  // namespace

InputLines::InputLines(asio::io_context& io, std::function<void(const std::string&)> on_line,
                       std::function<void(const Problem*)> on_end)
    : input_(io), buffer_(longest_line), on_line_(std::move(on_line)), on_end_(std::move(on_end)) {
  const int input = open_input();
  if (input < 0) {
    throw Error(ErrorKind::open, "standard input", std::strerror(errno),
                "connect standard input to a terminal, a pipe or a file");
  }
  with_system_errors("standard input", [&] { input_.assign(input); });
  read_line();
}

void InputLines::read_line() {
  asio::async_read_until(
      input_, buffer_, '\n', [this](const std::error_code& error, std::size_t size) {
        if (error == asio::error::operation_aborted) return;
        if (error == asio::error::not_found) {
          const Problem problem{ErrorKind::data, "standard input",
                                "a line is longer than 4096 bytes", "write shorter lines"};
          return on_end_(&problem);
        }
        if (error) size = buffer_.size();  // the last line may lack its end
        std::string line(size, '\0');
        std::istream(&buffer_).read(line.data(), static_cast<std::streamsize>(size));
        if (!line.empty()) on_line_(line);
        error ? on_end_(nullptr) : read_line();
      });
}

}  // namespace r4::tool
