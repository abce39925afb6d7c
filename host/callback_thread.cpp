// SPDX-License-Identifier: GPL-3.0-or-later
#include "callback_thread.hpp"

#include <utility>

namespace r4 {

namespace {

template <class... Calls>
struct Overloaded : Calls... {
  using Calls::operator()...;
};
template <class... Calls>
Overloaded(Calls...) -> Overloaded<Calls...>;

}  // namespace

CallbackThread::CallbackThread(std::function<void(Clock::duration)> on_end)
    : on_end_(std::move(on_end)), ring_(capacity) {}

// The last callback may have destroyed the board.
CallbackThread::~CallbackThread() {
  if (thread_.joinable()) thread_.detach();
}

void CallbackThread::start(std::shared_ptr<void> owner) {
  thread_ = std::thread([this, owner = std::move(owner)] { run(); });
}

void CallbackThread::stop() {
  std::deque<Task> gone;  // with what the callbacks have captured, destroyed without the lock
  {
    const std::lock_guard lock(mutex_);
    ended_ = true;
    taken_ = told_;
    gone.swap(tasks_);
  }
  news_.notify_all();
  if (on_it()) return;
  const std::lock_guard lock(joining_);
  if (thread_.joinable()) thread_.join();
}

void CallbackThread::tell(Notice notice) {
  {
    const std::lock_guard lock(mutex_);
    if (ended_) return;
    const bool waits = told_ > taken_ && (tasks_.empty() || tasks_.back().behind < told_);
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
    // An exception of the user's ends the program where it is thrown.
    [&]() noexcept {
      if (task) {
        task();
      } else {
        call(notice);
      }
    }();
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

// Waits for the next thing to do; false at the end.
bool CallbackThread::take(Notice& notice, std::function<void()>& task) {
  std::unique_lock lock(mutex_);
  news_.wait(lock, [&] { return ended_ || told_ > taken_ || !tasks_.empty(); });
  if (ended_) return false;
  if (!tasks_.empty() && tasks_.front().behind <= taken_) {
    task = std::move(tasks_.front().action);
    tasks_.pop_front();
  } else {
    notice = std::move(ring_[taken_++ % capacity]);
  }
  busy_since_ = Clock::now();
  return true;
}

void CallbackThread::call(const Notice& notice) {
  std::visit(Overloaded{
                 [&](const Restart&) {
                   state_ = ReceivedState();
                   call_each(restart_callbacks_);
                 },
                 [&](const ReceivedState& state) {
                   state_ = state;
                   call_each(state_callbacks_, state);
                 },
                 [&](const LinkStatus& link) {
                   link_ = link;
                   call_each(link_callbacks_, link);
                 },
                 [&](const CarrierEvent& event) {
                   if (event.kind == CarrierEvent::Kind::warning) {
                     warning_ = event;
                   } else {
                     event_ = event;
                     warning_.reset();
                   }
                   call_each(event_callbacks_, event);
                 },
                 [&](const PathStatus& path) { call_each(path_callbacks_, path); },
                 [&](DisarmCause cause) {
                   arming_ = cause;
                   call_each(arming_callbacks_, cause);
                 },
                 [&](const RefusedPost& refused) { call_each(refused_callbacks_, refused); },
                 [&](const UartNews& news) {
                   const Board::UartData data = take_uart_(news.channel);
                   if (data.bytes.empty() && data.lost == 0) return;
                   call_each(uart_callbacks_[news.channel - 1], data);
                 },
             },
             notice);
}

// In its place among the notices, so that nothing is told twice and nothing left out.
template <class Kind, class Function, class Tell>
Subscription CallbackThread::add(Kind& kind, Function callback, Tell tell) {
  if (!callback) return {};  // as Subscribers::add()
  const auto one = std::make_shared<typename Kind::One>(std::move(callback));
  {
    const std::lock_guard lock(mutex_);
    if (ended_) return {};
    tasks_.push_back({told_, [&kind, one, tell] {
                        kind.add(one);
                        tell(*one);
                      }});
    news_.notify_one();  // with the lock: the callback may be called at once, and destroy this
  }
  return Subscription(one);
}

Subscription CallbackThread::on_state(Subscribers<ReceivedState>::Function callback) {
  return add(state_callbacks_, std::move(callback), [this](auto& one) {
    if (state_.any()) one(state_);
  });
}
Subscription CallbackThread::on_link(Subscribers<LinkStatus>::Function callback) {
  return add(link_callbacks_, std::move(callback), [this](auto& one) { one(link_); });
}
Subscription CallbackThread::on_event(Subscribers<CarrierEvent>::Function callback) {
  return add(event_callbacks_, std::move(callback), [this](auto& one) {
    if (event_) one(*event_);
    if (warning_ && !ended_) one(*warning_);
  });
}
Subscription CallbackThread::on_path(Subscribers<PathStatus>::Function callback) {
  return add(path_callbacks_, std::move(callback), [](auto&) {});
}
Subscription CallbackThread::on_restart(Subscribers<>::Function callback) {
  return add(restart_callbacks_, std::move(callback), [](auto&) {});
}
Subscription CallbackThread::on_arming(Subscribers<DisarmCause>::Function callback) {
  return add(arming_callbacks_, std::move(callback), [this](auto& one) { one(arming_); });
}
Subscription CallbackThread::on_refused(Subscribers<RefusedPost>::Function callback) {
  return add(refused_callbacks_, std::move(callback), [](auto&) {});
}
Subscription CallbackThread::on_uart(int channel, Subscribers<Board::UartData>::Function callback) {
  return add(uart_callbacks_[channel - 1], std::move(callback), [](auto&) {});
}

}  // namespace r4
