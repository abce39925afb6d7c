// SPDX-License-Identifier: GPL-3.0-or-later
// Lines to standard output from a loop that must not wait for whoever reads them: a pipe that nobody
// empties, a terminal that is held. A thread of its own writes them; what does not fit into its room is
// lost and counted. An output that cannot be written holds nobody up either; finish() tells of it when
// the command ends.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>

#include "r4link/error.hpp"

namespace r4::tool {

class LineWriter {
 public:
  // `room`: for so many bytes that wait. `note` makes the line that stands where `count` lines are
  // missing; empty: none does.
  explicit LineWriter(std::size_t room, std::function<std::string(std::uint64_t count)> note = {});
  // Gives the reader a second to take what is left.
  ~LineWriter();
  LineWriter(const LineWriter&) = delete;
  LineWriter& operator=(const LineWriter&) = delete;

  // `line` with its end, which is written as printable_lines(). Never waits.
  void write(std::string_view line);

  // When no writer is left: throws Error if one could not write. Standard output is one for all.
  static void finish();
  // Lines that were left out.
  std::uint64_t lost() const;

 private:
  void run();
  bool write_out(std::string_view text);

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

// The error of a standard output that cannot be written, by errno.
Error output_error(int error);

}  // namespace r4::tool
