// SPDX-License-Identifier: GPL-3.0-or-later
#include "blocking_loop.hpp"

#include <asio/post.hpp>
#include <exception>
#include <utility>

#include "../commands/command_help.hpp"
#include "r4link/board.hpp"

namespace r4 {

namespace {

// The session ends every command at its deadline, which is that of the call. A call that has been begun and waits
// longer than this beyond it is held up by a loop that does not turn.
constexpr BlockingLoop::Duration grace{500};

// For what has no deadline of its own.
constexpr BlockingLoop::Duration patience{1000};
static_assert(patience == Board::default_timeout);

}  // namespace

Error BlockingLoop::closed_error(std::string_view what) const {
  std::string type(name_.thing);
  type[0] = static_cast<char>(type[0] - 'a' + 'A');
  return Error(Problem{ErrorKind::refused, std::string(what),
                       "the " + std::string(name_.thing) + " was closed",
                       "open it again with another " + type, Outcome::closed});
}

// `instead`: what that means for what was asked.
Error BlockingLoop::blocked_error(std::string_view what, std::string_view instead,
                                  std::string_view fix) const {
  return Error(Problem{
      ErrorKind::refused, std::string(what),
      std::string(instead) + ": the " + std::string(name_.thing) + "'s thread does not answer",
      std::string(fix), Outcome::blocked});
}

void BlockingLoop::run(const CallPtr& call, Duration timeout) {
  const auto deadline = call->called + bounded(timeout);
  std::unique_lock lock(mutex);
  if (closed) throw closed_error(call->text);
  asio::post(io, [this, call, deadline] { begin(call, deadline); });
  const auto is_done = [&] { return call->parts == 0; };
  bool done = false;
  try {
    done = wait_until(lock, call->ended, deadline, is_done) ||
           (call->begun && wait_until(lock, call->ended, deadline + grace, is_done));
  } catch (...) {
    if (!lock.owns_lock()) lock.lock();
    call->abandoned = true;
    if (!closed) {
      asio::post(io, [call] {
        for (auto& each : call->cancelled) each.emit(asio::cancellation_type::terminal);
      });
    }
    throw;
  }
  if (done) return;
  call->abandoned = true;
  if (call->stop) {
    throw blocked_error(call->text, "not confirmed; it goes out when it can", stop_last_resort);
  }
  throw blocked_error(call->text,
                      call->begun ? "not confirmed, it may have been executed or not" : "not sent",
                      name_.fix);
}

void BlockingLoop::run_unawaited(const CallPtr& call) {
  const std::lock_guard lock(mutex);
  if (closed) return;
  asio::post(io, [this, call, deadline = call->called + patience] { begin(call, deadline); });
}

bool BlockingLoop::run_on_loop(std::string_view what, const std::function<void()>& action) {
  struct Turn final : Call {
    std::exception_ptr trouble;
  };
  const auto turn = std::make_shared<Turn>();
  std::unique_lock lock(mutex);
  if (closed) return false;
  // `action` is the caller's, who is here as long as it runs.
  asio::post(io, [this, turn, &action] {
    {
      const std::lock_guard begin_lock(mutex);
      if (turn->abandoned) return;
      turn->begun = true;
    }
    try {
      action();
    } catch (...) {
      turn->trouble = std::current_exception();
    }
    finish(*turn, [] {});
  });
  const auto is_done = [&] { return turn->parts == 0; };
  if (!turn->ended.wait_for(lock, patience, is_done)) {
    if (!turn->begun) {
      turn->abandoned = true;
      throw blocked_error(what, "not done", name_.fix);
    }
    turn->ended.wait(lock, is_done);
  }
  if (turn->trouble) std::rethrow_exception(turn->trouble);
  return true;
}

void BlockingLoop::begin(const CallPtr& call, Clock::time_point deadline) {
  auto left = std::chrono::ceil<Duration>(deadline - Clock::now());
  {
    const std::lock_guard lock(mutex);
    if (!call->stop && (call->abandoned || left <= Duration{0})) return;
    call->begun = true;
  }
  call->start(call, left > Duration{0} ? left : patience);
}

void BlockingLoop::close(std::function<void()> shut) {
  {
    const std::lock_guard lock(mutex);
    if (!closed) asio::post(io, std::move(shut));
  }
  const std::lock_guard lock(joining_);
  if (thread_.joinable()) thread_.join();
}

void BlockingLoop::end_loop() {
  work_.reset();
  // Twice around: the ends of commands that begin() finds closed come behind this one.
  asio::post(io, [this] { asio::post(io, [this] { io.stop(); }); });
}

}  // namespace r4
