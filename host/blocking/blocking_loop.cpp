// SPDX-License-Identifier: GPL-3.0-or-later
#include "blocking_loop.hpp"

#include <asio/post.hpp>
#include <atomic>
#include <exception>
#include <future>
#include <utility>
#include <variant>

#include "r4link/board.hpp"

namespace r4 {

namespace {

// The session ends a command at its deadline. If a call lasts this much longer, the loop hangs.
constexpr BlockingLoop::Duration grace{500};

constexpr BlockingLoop::Duration patience{1000};
static_assert(patience == Board::default_timeout);

}  // namespace

BlockingLoop::Start BlockingLoop::start_of(CommandOrGroup what) {
  return [what = std::move(what)](AsyncBoard& board, std::size_t, Duration left, BoundEnd end) {
    std::visit([&](const auto& each) { board.async_send(each, left, std::move(end)); }, what);
  };
}

Error BlockingLoop::closed_error(std::string_view what) const {
  std::string type(name_.thing);
  type[0] = static_cast<char>(type[0] - 'a' + 'A');
  return Error(Problem{ErrorKind::refused, std::string(what),
                       "the " + std::string(name_.thing) + " was closed",
                       "open it again with another " + type, Outcome::closed});
}

// `instead`: the effect on the call, "not sent".
Error BlockingLoop::blocked_error(std::string_view what, std::string_view instead,
                                  std::string_view fix) const {
  return Error(Problem{
      ErrorKind::refused, std::string(what),
      std::string(instead) + ": the " + std::string(name_.thing) + "'s thread does not answer",
      std::string(fix), Outcome::blocked});
}

void BlockingLoop::run(const CallPtr& call, Duration timeout) {
  timeout = bounded(timeout);
  const auto deadline = Clock::now() + timeout;
  std::unique_lock lock(mutex);
  if (closed) throw closed_error(call->text);
  asio::post(io, [this, call, timeout] { begin(call, timeout); });
  const auto is_done_by = [&](Clock::time_point time) {
    return wait_until(lock, call->ended, time, on_wait, [&] { return call->left == 0; });
  };
  bool done = false;
  try {
    done = is_done_by(deadline) || (call->begun && is_done_by(deadline + grace));
  } catch (...) {
    if (!lock.owns_lock()) lock.lock();
    call->abandoned = true;
    if (!closed) {
      asio::post(io, [call] {
        for (Part& each : call->parts) each.cancelled.emit(asio::cancellation_type::terminal);
      });
    }
    throw;
  }
  if (done) return;
  call->abandoned = true;
  if (call->stop) {
    throw blocked_error(call->text, "not confirmed; the stop is sent as soon as possible",
                        stop_last_resort);
  }
  throw blocked_error(
      call->text,
      call->begun ? "not confirmed, the command may or may not have been executed" : "not sent",
      name_.fix);
}

void BlockingLoop::run_unawaited(const CallPtr& call) {
  post_to_loop([this, call] { begin(call, patience); });
}

bool BlockingLoop::post_to_loop(std::function<void()> action) {
  const std::lock_guard lock(mutex);
  if (!closed) asio::post(io, std::move(action));
  return !closed;
}

bool BlockingLoop::run_on_loop(std::string_view what, const std::function<void()>& action) {
  // `action` stays valid, because the caller waits while it runs.
  struct Turn {
    std::atomic<bool> taken{false};  // begun by the loop, or abandoned by the caller
    std::exception_ptr thrown;
    std::promise<void> ended;
  };
  const auto turn = std::make_shared<Turn>();
  const std::future<void> ended = turn->ended.get_future();
  const bool open = post_to_loop([turn, &action] {
    if (turn->taken.exchange(true)) return;
    try {
      action();
    } catch (...) {
      turn->thrown = std::current_exception();
    }
    turn->ended.set_value();
  });
  if (!open) return false;
  const bool late = ended.wait_for(patience) != std::future_status::ready;
  if (late && !turn->taken.exchange(true)) throw blocked_error(what, "not done", name_.fix);
  ended.wait();
  // From here only the caller has the exception. ThreadSanitizer cannot see how libstdc++ counts
  // its owners.
  if (turn->thrown) std::rethrow_exception(std::exchange(turn->thrown, nullptr));
  return true;
}

void BlockingLoop::begin(const CallPtr& call, Duration timeout) {
  auto left = std::chrono::ceil<Duration>(call->called + timeout - BootClock::now());
  {
    const std::lock_guard lock(mutex);
    if (!call->stop && (call->abandoned || left <= Duration{0})) return;
    call->begun = true;
  }
  if (left <= Duration{0}) left = patience;
  for (std::size_t i = 0; i < call->parts.size(); ++i) {
    Part& part = call->parts[i];
    try {
      call->start(*part.board, i, left, BoundEnd(part.cancelled.slot(), End{this, call, i}));
    } catch (const Error& error) {
      part.trouble = error.problem();
      end(*call, i, {Outcome::refused});
    }
  }
}

void BlockingLoop::end(Call& call, std::size_t part, const CommandResult& result) {
  const std::lock_guard lock(mutex);
  Part& ended = call.parts[part];
  ended.result = result;
  ended.result.elapsed = std::chrono::duration_cast<Time>(BootClock::now() - call.called);
  ended.link = ended.board->link();
  on_end();
  if (--call.left == 0) call.ended.notify_all();
}

void BlockingLoop::close(const std::vector<AsyncBoard*>& boards) {
  post_to_loop([this, boards] { shut(boards); });
  const std::lock_guard lock(joining_);
  if (thread_.joinable()) thread_.join();
}

void BlockingLoop::shut(const std::vector<AsyncBoard*>& boards) {
  {
    const std::lock_guard lock(mutex);
    if (std::exchange(closed, true)) return;
    on_close();
  }
  news.notify_all();
  leaving_ = boards.size();
  for (AsyncBoard* const board : boards) {
    board->async_close(farewell_limit, [this](const CommandResult&) {
      if (--leaving_ != 0) return;
      work_.reset();
      // Posted twice, because begin() may post the end of a command on a closed board.
      asio::post(io, [this] { asio::post(io, [this] { io.stop(); }); });
    });
  }
}

}  // namespace r4
