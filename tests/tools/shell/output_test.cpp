// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/r4/shell/output.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <string>
#include <string_view>
#include <thread>

#include "r4link/error.hpp"

namespace r4::tool {
namespace {

// Standard output is a pipe while this object exists.
class PipedOutput {
 public:
  explicit PipedOutput(int flags = 0) {
    EXPECT_EQ(::pipe2(ends_.data(), flags), 0);
    EXPECT_EQ(::dup2(ends_[1], STDOUT_FILENO), STDOUT_FILENO);
    ::close(ends_[1]);
  }
  ~PipedOutput() {
    close_reader();
    ::dup2(stdout_, STDOUT_FILENO);
    ::close(stdout_);
  }
  PipedOutput(const PipedOutput&) = delete;
  PipedOutput& operator=(const PipedOutput&) = delete;

  // Reads everything up to `end`.
  std::string read_to(std::string_view end) const {
    std::string text;
    std::array<char, 4096> buffer;
    while (!text.ends_with(end)) {
      const ssize_t n = ::read(ends_[0], buffer.data(), buffer.size());
      if (n > 0) text.append(buffer.data(), static_cast<std::size_t>(n));
      if (n == 0) break;
      if (n < 0) std::this_thread::yield();
    }
    return text;
  }
  void close_reader() {
    if (ends_[0] >= 0) ::close(ends_[0]);
    ends_[0] = -1;
  }

 private:
  std::array<int, 2> ends_{};
  const int stdout_ = ::dup(STDOUT_FILENO);
};

TEST(Output, ArrivesCompletelyThroughAFullNonBlockingPipe) {
  std::string text;
  for (int i = 0; text.size() < 1'000'000; ++i) text += std::to_string(i) + "\n";
  text += "end\n";
  PipedOutput pipe(O_NONBLOCK);
  std::string read;
  std::thread reader([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    read = pipe.read_to("end\n");
  });
  print_raw(text);
  reader.join();
  EXPECT_EQ(read, text);
}

TEST(Output, PrintsControlCharactersAsText) {
  const PipedOutput pipe;
  print_text("{}\n", "a\x1b[2Jb");
  print_text("{kept}\n");
  EXPECT_EQ(pipe.read_to("}\n"), "a\\x1b[2Jb\n{kept}\n");
}

void print_to_nobody() {
  std::signal(SIGPIPE, SIG_IGN);
  PipedOutput pipe;
  pipe.close_reader();
  print_text("the board has stopped\n");
  print_text("more\n");  // after one failure, there is no further attempt and no exception
  try {
    require_output();
  } catch (const Error& error) {
    std::_Exit(error.kind() == ErrorKind::open ? 7 : 1);
  }
  std::_Exit(0);
}

TEST(Output, ReportsAClosedReaderAtTheEnd) {
  EXPECT_EXIT(print_to_nobody(), testing::ExitedWithCode(7), "");
}

TEST(Output, OfALoopNeverBlocksAndCountsMissingLines) {
  const PipedOutput pipe;
  LineWriter lines(100'500, [](std::uint64_t count) { return fmt::format("{}\n", count); });
  const std::string line = std::string(999, 'x') + "\n";
  for (int i = 0; i < 1000; ++i) lines.write(line);
  EXPECT_GE(lines.lost(), 500U);
  std::string all = pipe.read_to("x\n");
  lines.write("end\n");
  all += pipe.read_to("end\n");
  std::uint64_t found = 0;
  for (std::size_t at = 0; at < all.size(); at = all.find('\n', at) + 1) {
    found += all[at] == 'x' ? 1 : std::strtoull(&all[at], nullptr, 10);
  }
  EXPECT_EQ(found, 1000U);
}

}  // namespace
}  // namespace r4::tool
