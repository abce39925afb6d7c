// SPDX-License-Identifier: GPL-3.0-or-later
// If the system refuses a resource, the call that needs the resource throws an Error with that
// reason.
#include <gtest/gtest.h>
#include <unistd.h>

#include <asio/io_context.hpp>
#include <filesystem>
#include <functional>
#include <string>

#include "r4link/async_board.hpp"
#include "r4link/board.hpp"
#include "r4link/bridge.hpp"
#include "r4link/error.hpp"
#include "r4link/fleet.hpp"
#include "r4link/recording.hpp"
#include "tests/support/refused_calls.hpp"

namespace r4::test {
namespace {

const std::string a_board = "udp://127.0.0.1:9?listen=0";

// The error of `action` in a thread whose system call `refused` fails.
std::string error_where(const RefusedCall& refused, const std::function<void()>& action) {
  std::string text = "none";
  in_a_thread_of_its_own([&] {
    refuse(refused);
    try {
      action();
    } catch (const Error& error) {
      text = error.what();
    }
  });
  return text;
}

TEST(BoardResources, ReportsThatNoThreadIsLeft) {
  const std::string no_thread =
      ": this user has reached the limit of threads; end some programs, or raise the limit, "
      "which ulimit -u shows";
  EXPECT_EQ(error_where(no_threads, [] { const Board board("sim:"); }), "a board" + no_thread);
  EXPECT_EQ(error_where(no_threads, [] { const Fleet fleet({"sim:"}); }), "a fleet" + no_thread);
  EXPECT_EQ(error_where(no_threads,
                        [] { const Bridge bridge("udp://127.0.0.1:0", "udp://127.0.0.1:9"); }),
            "a bridge" + no_thread);
  const std::string file =
      std::filesystem::temp_directory_path() / ("r4-" + std::to_string(::getpid()) + ".r4log");
  EXPECT_EQ(error_where(no_threads, [&] { const Recording recording(file); }), file + no_thread);
  std::filesystem::remove(file);
}

TEST(BoardResources, ReportsThatTheSystemRefusesToWatchAFile) {
  const auto is_told = [](const std::string& error) {
    return error.find("reached the limit of epoll watches") != std::string::npos;
  };
  EXPECT_PRED1(is_told, error_where(no_watches, [] { const Board board(a_board); }));
  EXPECT_PRED1(is_told, error_where(no_watches, [] { const Board board("sim:"); }));
  EXPECT_PRED1(is_told, error_where(no_watches, [] { const Fleet fleet({a_board}); }));
  EXPECT_PRED1(is_told, error_where(no_watches, [] {
                 const Bridge bridge("udp://127.0.0.1:0", "udp://127.0.0.1:9");
               }));
  EXPECT_PRED1(is_told, error_where(no_watches, [] {
                 asio::io_context io;
                 AsyncBoard(io.get_executor(), a_board).open();
               }));
}

}  // namespace
}  // namespace r4::test
