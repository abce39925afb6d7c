// SPDX-License-Identifier: GPL-3.0-or-later
// A child process inherits no descriptor of a transport, because the descriptor would keep the port
// open.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <asio/io_context.hpp>
#include <filesystem>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "recorder.hpp"

namespace r4::test {
namespace {

// The number and the file of each open descriptor that a child process inherits.
std::set<std::string> inherited() {
  std::set<std::string> all;
  for (const auto& each : std::filesystem::directory_iterator("/proc/self/fd")) {
    const int number = std::stoi(each.path().filename());
    const int flags = ::fcntl(number, F_GETFD);
    if (flags < 0 || (flags & FD_CLOEXEC) != 0) continue;
    std::error_code ignored;
    all.insert(each.path().filename().string() + " " +
               std::filesystem::read_symlink(each.path(), ignored).string());
  }
  return all;
}

TEST(Descriptors, AreNotInheritedByChildProcesses) {
  const std::set<std::string> before = inherited();
  asio::io_context io;
  Recorder events;
  std::vector<std::unique_ptr<Carrier>> open;
  for (const char* const url : {"udp://127.0.0.1:0", "udp://0.0.0.0:0", "udp://[::1]:0"}) {
    open.push_back(open_carrier(io, url, Role::board, events));
  }
  open.push_back(open_carrier(io, "pty:", Role::board, events));
  open.push_back(open_carrier(io, "serial://" + open.back()->name().substr(4), Role::host, events));
  const std::string board = open.front()->name();
  for (int i = 0; i < 12; ++i) {  // so many that a loop reads several sockets together
    open.push_back(open_carrier(io, board + "?listen=0", Role::host, events));
  }
  io.poll();
  EXPECT_EQ(inherited(), before);
}

}  // namespace
}  // namespace r4::test
