// SPDX-License-Identifier: GPL-3.0-or-later
// All output of r4 goes through here, without buffering. A failed write does not end a command: a
// stop must reach the board even if the disk is full. require_output() reports the failure at the
// end. If the reader closes a pipe, SIGPIPE ends r4 without a farewell.
#pragma once

#include <fmt/format.h>

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>
#include <utility>

namespace r4::tool {

// Applies printable() to each line, because text for people may contain foreign names.
std::string printable_lines(std::string_view text);

// Prints printable_lines(text). Blocks until the reader takes the text.
void print_text(std::string_view text);
template <class First, class... Rest>
void print_text(fmt::format_string<First, Rest...> format, First&& first, Rest&&... rest) {
  print_text(fmt::format(format, std::forward<First>(first), std::forward<Rest>(rest)...));
}
// Prints the bytes unchanged: our own text with cursor control, and bytes for programs.
void print_raw(std::string_view text);
void print_trouble(std::string_view text);
template <class First, class... Rest>
void print_trouble(fmt::format_string<First, Rest...> format, First&& first, Rest&&... rest) {
  print_trouble(fmt::format(format, std::forward<First>(first), std::forward<Rest>(rest)...));
}

// Throws Error if a write failed. Call when no LineWriter is left.
void require_output();

// Writes lines in a thread, for a loop that must not wait for the reader: a full pipe or a stopped
// terminal. A line that does not fit into the room is dropped and counted.
class LineWriter {
 public:
  // `room`: most bytes that wait. `note` makes the line printed where `count` lines were dropped.
  explicit LineWriter(std::size_t room, std::function<std::string(std::uint64_t count)> note = {});
  // Gives the reader one second to take the rest.
  ~LineWriter();
  LineWriter(const LineWriter&) = delete;
  LineWriter& operator=(const LineWriter&) = delete;

  // Never blocks. `line` includes its end and is printed as printable_lines().
  void write(std::string_view line);

  std::uint64_t lost() const;

 private:
  void run();

  const std::size_t room_;
  const std::function<std::string(std::uint64_t)> note_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::string waiting_;
  std::uint64_t lost_ = 0;
  std::uint64_t noted_ = 0;
  bool ending_ = false;
  std::thread thread_;
};

}  // namespace r4::tool
