// SPDX-License-Identifier: GPL-3.0-or-later
// Standard output: all that r4 prints goes through here, and to the system at once. An output that cannot be written
// stops no command: a stop must reach the board although the disk is full. require_output() reports it at the end.
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

// Each line of it printable(): for a text for people in which names of others may be.
std::string printable_lines(std::string_view text);

// Text for people, by printable_lines(). Waits for the reader.
void print_text(std::string_view text);
template <class First, class... Rest>
void print_text(fmt::format_string<First, Rest...> format, First&& first, Rest&&... rest) {
  print_text(fmt::format(format, std::forward<First>(first), std::forward<Rest>(rest)...));
}
// The same bytes: text of our own, which may move the cursor, and bytes for programs.
void print_raw(std::string_view text);
// A line for people on standard error, printable().
void print_trouble(std::string_view text);
template <class First, class... Rest>
void print_trouble(fmt::format_string<First, Rest...> format, First&& first, Rest&&... rest) {
  print_trouble(fmt::format(format, std::forward<First>(first), std::forward<Rest>(rest)...));
}

// Throws Error if something printed could not be written, once no LineWriter is left.
void require_output();

// Lines from a loop that must not wait for the reader: a pipe that nobody empties, a terminal that is held. A thread
// writes them; a line that does not fit into the room is lost and counted.
class LineWriter {
 public:
  // `room`: for so many bytes that wait. `note` makes the line that stands where `count` lines are missing.
  explicit LineWriter(std::size_t room, std::function<std::string(std::uint64_t count)> note = {});
  // Gives the reader a second to take what is left.
  ~LineWriter();
  LineWriter(const LineWriter&) = delete;
  LineWriter& operator=(const LineWriter&) = delete;

  // `line` with its end, which is written as printable_lines(). Never waits.
  void write(std::string_view line);

  // Lines that were left out.
  std::uint64_t lost() const;

 private:
  void run();

  const std::size_t room_;
  const std::function<std::string(std::uint64_t)> note_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::string waiting_;
  std::uint64_t lost_ = 0;
  std::uint64_t noted_ = 0;  // of them, by a line
  bool ending_ = false;
  std::thread thread_;
};

}  // namespace r4::tool
