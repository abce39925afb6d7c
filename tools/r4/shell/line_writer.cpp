// SPDX-License-Identifier: GPL-3.0-or-later
#include "line_writer.hpp"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <climits>
#include <cstring>
#include <utility>

#include "json.hpp"

namespace r4::tool {
namespace {

using Clock = std::chrono::steady_clock;
constexpr std::chrono::seconds farewell{1};

std::atomic<int> first_error{0};  // the errno of the first write that failed

}  // namespace

LineWriter::LineWriter(std::size_t room, std::function<std::string(std::uint64_t count)> note)
    : room_(room), note_(std::move(note)), thread_([this] { run(); }) {}

LineWriter::~LineWriter() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  changed_.notify_one();
  thread_.join();
}

void LineWriter::write(std::string_view line) {
  {
    const std::lock_guard lock(mutex_);
    if (waiting_.size() + line.size() > room_) {
      ++lost_;
      return;
    }
    const std::uint64_t missing = lost_ - std::exchange(noted_, lost_);
    if (missing != 0 && note_) waiting_ += note_(missing);
    waiting_ += line;
  }
  changed_.notify_one();
}

std::uint64_t LineWriter::lost() const {
  const std::lock_guard lock(mutex_);
  return lost_;
}

void LineWriter::finish() {
  if (first_error != 0) throw output_error(first_error);
}

Error output_error(int error) {
  return Error(ErrorKind::open, "standard output", std::strerror(error),
               "make room where it goes, or send it elsewhere");
}

void LineWriter::run() {
  std::string text;
  for (;;) {
    text.clear();
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [this] { return ending_ || !waiting_.empty(); });
      if (waiting_.empty()) return;
      text.swap(waiting_);
    }
    if (!write_out(printable_lines(text))) return;
  }
}

// What poll() calls writable takes PIPE_BUF bytes without waiting. False if it is time to give up.
bool LineWriter::write_out(std::string_view text) {
  Clock::time_point deadline = Clock::time_point::max();
  while (!text.empty()) {
    pollfd out{STDOUT_FILENO, POLLOUT, 0};
    const int ready = ::poll(&out, 1, 100);
    {
      const std::lock_guard lock(mutex_);
      if (ending_ && deadline == Clock::time_point::max()) deadline = Clock::now() + farewell;
    }
    if (ready == 0 && Clock::now() >= deadline) return false;
    if (ready <= 0) continue;
    const ssize_t written =
        ::write(STDOUT_FILENO, text.data(), std::min<std::size_t>(text.size(), PIPE_BUF));
    if (written > 0) {
      text.remove_prefix(static_cast<std::size_t>(written));
    } else if (const int error = errno; error != EINTR && error != EAGAIN) {
      int none = 0;
      first_error.compare_exchange_strong(none, error);
      return false;
    }
  }
  return true;
}

}  // namespace r4::tool
