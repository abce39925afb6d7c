// SPDX-License-Identifier: GPL-3.0-or-later
#include "child_board.hpp"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <asio/buffer.hpp>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <string_view>

#include "r4link/error.hpp"
#include "transports/file_descriptor.hpp"

namespace r4::tool {
namespace {

// The child ends by itself if r4 cannot end it.
constexpr const char* longest_life_s = "60";

pid_t spawn(const std::string& url, int output) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, output, STDOUT_FILENO);
  // SIGTERM ends the child even if r4 was started with SIGTERM ignored.
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t ends;
  ::sigemptyset(&ends);
  ::sigaddset(&ends, SIGTERM);
  posix_spawnattr_setsigdefault(&attributes, &ends);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGDEF);
  const char* const arguments[] = {"r4",         "sim",          url.c_str(), "--json",
                                   "--duration", longest_life_s, nullptr};
  pid_t pid = 0;
  const int error = ::posix_spawn(&pid, "/proc/self/exe", &actions, &attributes,
                                  const_cast<char* const*>(arguments), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) {
    throw Error(ErrorKind::open, "r4 sim " + url,
                std::string("cannot be started: ") + std::strerror(error),
                "check that /proc is mounted, and that memory is free");
  }
  return pid;
}

}  // namespace

ChildBoard::ChildBoard(asio::io_context& io, const std::string& url, OnEvent on_event)
    : on_event_(std::move(on_event)), output_(io) {
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) {
    throw Error(ErrorKind::open, "a pipe", std::strerror(errno), "close some programs");
  }
  with_system_errors("a pipe", [&] { output_.assign(ends[0]); });
  try {
    pid_ = spawn(url, ends[1]);
  } catch (...) {
    ::close(ends[1]);
    throw;
  }
  ::close(ends[1]);
  read_more();
}

ChildBoard::~ChildBoard() {
  std::error_code ignored;
  output_.close(ignored);
  ::kill(pid_, SIGTERM);
  while (::waitpid(pid_, nullptr, 0) < 0 && errno == EINTR) {
  }
}

void ChildBoard::read_more() {
  output_.async_read_some(asio::buffer(buffer_),
                          [this](const std::error_code& error, std::size_t n) {
                            if (error == asio::error::operation_aborted) return;
                            if (error) {
                              on_event_({{"type", "ended"}});
                              return;
                            }
                            take({buffer_.data(), n});
                            read_more();
                          });
}

void ChildBoard::take(std::string_view bytes) {
  for (std::size_t end = bytes.find('\n'); end != std::string_view::npos; end = bytes.find('\n')) {
    line_ += bytes.substr(0, end);
    bytes.remove_prefix(end + 1);
    const Json event = Json::parse(line_, nullptr, false);
    line_.clear();
    if (event.is_object()) on_event_(event);
  }
  line_ += bytes;
}

}  // namespace r4::tool
