// SPDX-License-Identifier: GPL-3.0-or-later
#include "callback_thread.hpp"

#include <type_traits>
#include <utility>

namespace r4 {

CallbackThread::CallbackThread(std::function<void(Clock::duration)> on_end,
                               std::function<Board::UartData(int channel)> take_uart)
    : on_end_(std::move(on_end)), take_uart_(std::move(take_uart)), ring_(capacity) {}

// If a callback destroys the board, this thread cannot join itself.
CallbackThread::~CallbackThread() {
  if (thread_.joinable()) thread_.detach();
}

void CallbackThread::start(std::shared_ptr<void> owner) {
  thread_ = std::thread([this, owner = std::move(owner)] { run(); });
}

void CallbackThread::stop() {
  std::deque<Task> gone;  // captures of the callbacks, destroyed without the lock
  {
    const std::lock_guard lock(mutex_);
    ended_ = true;
    taken_ = told_;
    gone.swap(tasks_);
  }
  news_.notify_all();
  if (std::this_thread::get_id() == id_.load()) return;
  const std::lock_guard lock(joining_);
  if (thread_.joinable()) thread_.join();
}

void CallbackThread::notify(Notice notice) {
  {
    const std::lock_guard lock(mutex_);
    if (ended_) return;
    const bool waits = told_ > taken_ && (tasks_.empty() || tasks_.back().after < told_);
    Notice& newest = ring_[(told_ + capacity - 1) % capacity];
    if (waits && std::holds_alternative<ReceivedState>(newest) &&
        std::holds_alternative<ReceivedState>(notice)) {
      newest = std::move(notice);
      return;
    }
    const auto* const event = std::get_if<CarrierEvent>(&notice);
    const bool can_be_missed = std::holds_alternative<RefusedPost>(notice) ||
                               (event != nullptr && event->kind == CarrierEvent::Kind::warning);
    if (can_be_missed && told_ - taken_ >= capacity / 2) return;
    if (told_ - taken_ == capacity) ++taken_;
    ring_[told_++ % capacity] = std::move(notice);
  }
  news_.notify_one();
}

std::optional<CallbackThread::Clock::duration> CallbackThread::busy_for() const {
  const std::lock_guard lock(mutex_);
  if (!busy_since_) return {};
  return Clock::now() - *busy_since_;
}

void CallbackThread::run() {
  id_ = std::this_thread::get_id();
  Notice notice;
  std::function<void()> task;
  while (take(notice, task)) {
    // noexcept: an exception from a callback ends the program where it is thrown.
    [&]() noexcept { task ? task() : call(notice); }();
    task = nullptr;
    Clock::duration busy;
    {
      const std::lock_guard lock(mutex_);
      busy = Clock::now() - *busy_since_;
      busy_since_.reset();
    }
    on_end_(busy);
  }
}

bool CallbackThread::take(Notice& notice, std::function<void()>& task) {
  std::unique_lock lock(mutex_);
  news_.wait(lock, [&] { return ended_ || told_ > taken_ || !tasks_.empty(); });
  if (ended_) return false;
  if (!tasks_.empty() && tasks_.front().after <= taken_) {
    task = std::move(tasks_.front().action);
    tasks_.pop_front();
  } else {
    notice = std::move(ring_[taken_++ % capacity]);
  }
  busy_since_ = Clock::now();
  return true;
}

void CallbackThread::call(const Notice& notice) {
  const auto report = [&](const auto& news) {
    using Kind = std::decay_t<decltype(news)>;
    if constexpr (std::is_same_v<Kind, UartNews>) {
      const Board::UartData data = take_uart_(news.channel);
      if (data.bytes.empty() && data.lost == 0) return;
      call_each(uart_callbacks_[news.channel - 1], data);
    } else {
      keep(news);
      call_each(std::get<Subscribers<Kind>>(callbacks_), news);
    }
  };
  std::visit(report, notice);
}

void CallbackThread::keep(const CarrierEvent& event) {
  const bool is_warning = event.kind == CarrierEvent::Kind::warning;
  if (!is_warning) warning_.reset();
  (is_warning ? warning_ : event_) = event;
}

}  // namespace r4
