// SPDX-License-Identifier: GPL-3.0-or-later
#include "output.hpp"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <climits>
#include <cstdio>
#include <cstring>
#include <optional>
#include <utility>

#include "r4link/error.hpp"

namespace r4::tool {
namespace {

using Clock = std::chrono::steady_clock;
constexpr std::chrono::seconds last_wait{1};

std::atomic<int> first_error{0};  // errno of the first failed write

// Returns false if a write failed, or if `give_up` is true while the reader takes nothing. After
// poll() reports writable, a write of PIPE_BUF bytes does not block.
template <class GiveUp>
bool write_out(std::string_view text, GiveUp give_up) {
  while (!text.empty() && first_error == 0) {
    pollfd out{STDOUT_FILENO, POLLOUT, 0};
    const int ready = ::poll(&out, 1, 100);
    if (give_up() && ready == 0) return false;
    if (ready <= 0) continue;
    const ssize_t written =
        ::write(STDOUT_FILENO, text.data(), std::min<std::size_t>(text.size(), PIPE_BUF));
    if (written > 0) {
      text.remove_prefix(static_cast<std::size_t>(written));
    } else if (const int error = errno; error != EINTR && error != EAGAIN) {
      int none = 0;
      first_error.compare_exchange_strong(none, error);
    }
  }
  return first_error == 0;
}

}  // namespace

std::string printable_lines(std::string_view text) {
  std::string out;
  for (std::size_t end = 0; end != std::string_view::npos;) {
    end = text.find('\n');
    out += printable(text.substr(0, end));
    if (end == std::string_view::npos) break;
    out += '\n';
    text.remove_prefix(end + 1);
  }
  return out;
}

void print_raw(std::string_view text) {
  write_out(text, [] { return false; });
}

void print_text(std::string_view text) { print_raw(printable_lines(text)); }

void print_trouble(std::string_view text) {
  const std::string line = printable(text) + '\n';
  static_cast<void>(std::fwrite(line.data(), 1, line.size(), stderr));
}

void require_output() {
  if (first_error == 0) return;
  throw Error(ErrorKind::open, "standard output", std::strerror(first_error),
              "free some disk space, or write the output to another place");
}

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

void LineWriter::run() {
  std::string text;
  std::optional<Clock::time_point> deadline;
  for (;;) {
    text.clear();
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [this] { return ending_ || !waiting_.empty(); });
      if (waiting_.empty()) return;
      text.swap(waiting_);
    }
    const auto give_up = [this, &deadline] {
      const std::lock_guard lock(mutex_);
      if (ending_ && !deadline) deadline = Clock::now() + last_wait;
      return deadline && Clock::now() >= *deadline;
    };
    if (!write_out(printable_lines(text), give_up)) return;
  }
}

}  // namespace r4::tool
