// SPDX-License-Identifier: GPL-3.0-or-later
#include "board.hpp"

#include <algorithm>
#include <asio/executor_work_guard.hpp>
#include <asio/io_context.hpp>
#include <asio/post.hpp>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>

#include "async_board.hpp"
#include "callback.hpp"
#include "commands/command_help.hpp"
#include "explain.hpp"
#include "session/limits.hpp"
#include "post_box.hpp"

namespace r4 {

namespace {

using Clock = std::chrono::steady_clock;

// The session ends every command at its deadline, which is that of the call. A call that has been
// begun and waits longer than this beyond it is held up by a callback that does not return.
constexpr std::chrono::milliseconds grace{500};

// A day is as good as for ever, and cannot overflow.
Board::Duration bounded(Board::Duration timeout) {
  return std::clamp<Board::Duration>(timeout, Board::Duration{0}, std::chrono::hours{24});
}

Error closed_error(std::string_view what) {
  return Error(ErrorKind::refused, std::string(what), "cancelled: the board was closed",
               "open it again with another Board");
}

// A callback holds the board's thread. `instead`: what that means for what was asked.
Error blocked_error(std::string_view what, std::string_view instead) {
  return Error(ErrorKind::refused, std::string(what),
               std::string(instead) + ": the board's thread does not answer",
               "a callback must return at once; do the work in another thread");
}

}  // namespace

// The board's thread runs the loop, on which everything of AsyncBoard happens. The threads meet
// under `mutex`: callers hand work to the loop and wait there for its end, or for news.
struct Board::Impl : std::enable_shared_from_this<Board::Impl> {
  // Something asked of the loop, and its answer. Held by both sides, since the caller may give up:
  // what the loop has not begun by then, it leaves alone.
  struct Call {
    explicit Call(const Command& c)
        : command(c), text(c.text.data(), c.text.size()), text2(c.text2.data(), c.text2.size()) {
      command.text = text;
      command.text2 = text2;
    }
    Command command;
    std::string text, text2;
    const Clock::time_point called = Clock::now();
    // For what is not one command: has the loop begin it, with the time that is left.
    using End = std::function<void(const CommandResult&)>;
    std::function<void(Duration left, End end)> start;
    bool begun = false;
    bool abandoned = false;
    bool arms = false;  // arm(): there is no command
    bool done = false;
    std::condition_variable ended;
    CommandResult result;
    LinkStatus link;
    BoardIdentity identity;
  };
  using CallPtr = std::shared_ptr<Call>;

  Impl(std::string_view url_given, BoardOptions options)
      : arming(options.session.arming),
        async(io, url_given, std::move(options)),
        box(io, [this](const Command& c) { deliver(c); }),
        url(url_given) {
    // An exception of the user's ends the program where it is thrown.
    async.on_state([this](const ReceivedState& fresh, const Datagram&) noexcept {
      {
        const std::lock_guard lock(mutex);
        state = fresh;
        ++states;
        in_control = async.in_control();
      }
      news.notify_all();
      state_callback(fresh);
    });
    async.on_link([this](const LinkStatus& fresh) noexcept {
      {
        const std::lock_guard lock(mutex);
        link = fresh;
        state = async.state();  // heartbeats change its `safe`
        in_control = async.in_control();
      }
      news.notify_all();
      link_callback(fresh);
    });
    async.on_event([this](const CarrierEvent& event) noexcept {
      take_name();  // a board that was plugged in again may be at another port
      if (event.kind == CarrierEvent::Kind::warning) {
        last_warning = event;
      } else {
        last_event = event;
        last_warning.reset();
      }
      event_callback(event);
    });
    async.on_arming([this](DisarmCause fresh) noexcept {
      {
        const std::lock_guard lock(mutex);
        disarmed_by = fresh;
      }
      arming_callback(fresh);
    });
    async.on_refused([this](const RefusedPost& refused) noexcept { refused_callback(refused); });
    async.on_restart([this]() noexcept {
      {
        const std::lock_guard lock(mutex);
        state = async.state();
      }
      restart_callback();
    });
    async.open();
    take_name();
  }

  void take_name() {
    const std::lock_guard lock(mutex);
    name = async.name();
  }
  std::string name_now() {
    const std::lock_guard lock(mutex);
    return name;
  }

  LinkStatus link_now() {
    const std::lock_guard lock(mutex);
    return link;
  }
  std::uint64_t states_now() {
    const std::lock_guard lock(mutex);
    return states;
  }

  void start() {
    thread = std::thread([self = shared_from_this()] { self->io.run(); });
  }

  // --- on the loop

  void deliver(const Command& command) {
    if (command.kind == CommandKind::stop) {
      async.async_stop(default_timeout, [](const CommandResult&) {});
    } else if (const PostResult result = async.post(command); !result) {
      RefusedPost refused{command, Refusal::none, result};
      refused.command.text = refused.command.text2 = Text();
      refused_callback(refused);
    }
  }

  // A stop is sent however late it is; anything else only while its caller waits for it.
  void begin(const CallPtr& call, Clock::time_point deadline) {
    const bool stop = call->command.kind == CommandKind::stop;
    auto left = std::chrono::ceil<Duration>(deadline - Clock::now());
    {
      const std::lock_guard lock(mutex);
      if (!stop && (call->abandoned || left <= Duration{0})) return;
      call->begun = true;
    }
    auto end = [this, call](const CommandResult& result) { finish(*call, result); };
    if (call->arms) {
      async.async_arm(left, std::move(end));
    } else if (call->start) {
      call->start(left, std::move(end));
    } else if (stop) {
      async.async_stop(left > Duration{0} ? left : default_timeout, std::move(end));
    } else if (call->command.kind == CommandKind::identify) {
      async.async_identify(left, std::move(end));
    } else {
      async.async_send(call->command, left, std::move(end));
    }
  }

  void finish(Call& call, const CommandResult& result) {
    {
      const std::lock_guard lock(mutex);
      call.result = result;
      call.result.elapsed = std::chrono::duration_cast<Time>(Clock::now() - call.called);
      call.link = async.link();
      call.identity = async.identity();
      call.done = true;
    }
    call.ended.notify_all();
  }

  // After this, nothing more is put on the loop; what is on it is carried out, then the loop ends.
  void shut() {
    {
      const std::lock_guard lock(mutex);
      if (closed) return;
      closed = true;
      last_statistics = async.statistics();
    }
    news.notify_all();
    async.close();
    work.reset();
    // Twice around: the ends of commands that begin() finds closed come behind this one.
    asio::post(io, [this] { asio::post(io, [this] { io.stop(); }); });
  }

  // --- on any thread

  bool in_loop() { return io.get_executor().running_in_this_thread(); }

  void must_not_be_in_loop(std::string_view what) {
    if (!in_loop()) return;
    throw Error(ErrorKind::usage, std::string(what), "a callback must not wait for the board",
                "use post() or stop_async(), or call it from another thread");
  }

  void require_sendable(const Command& command) {
    require_valid(command);
    require_cable(url, command);
  }

  // Has the loop carry out a command. Throws if it is not confirmed.
  CallPtr execute(const Command& command, Duration timeout) {
    return execute(shown(command), std::make_shared<Call>(command), timeout);
  }
  CallPtr execute(const std::string& text, CallPtr call, Duration timeout) {
    must_not_be_in_loop(text);
    const auto deadline = call->called + bounded(timeout);
    std::unique_lock lock(mutex);
    if (closed) throw closed_error(text);
    asio::post(io, [this, call, deadline] { begin(call, deadline); });
    const auto is_done = [&] { return call->done; };
    if (!call->ended.wait_until(lock, deadline, is_done) &&
        !(call->begun && call->ended.wait_until(lock, deadline + grace, is_done))) {
      call->abandoned = true;
      if (call->command.kind == CommandKind::stop) {
        throw Error(ErrorKind::refused, text,
                    "not confirmed: the board's thread does not answer, and sends it when it does",
                    std::string(stop_last_resort) + "; a callback must return at once");
      }
      throw blocked_error(
          text, call->begun ? "not confirmed, it may have been executed or not" : "not sent");
    }
    if (call->result.outcome == Outcome::confirmed) return call;
    if (closed && call->result.outcome == Outcome::cancelled) throw closed_error(text);
    throw Error(explain(text, call->result, call->link));
  }

  // Does `action` on the loop and waits until it is done, then has the loop go on with `after`;
  // nothing if the board is closed. Throws if the loop does not begin in time; then it never will.
  // On the loop itself it does `action` alone.
  template <class Action, class After>
  void run_on_loop(std::string_view what, Action action, After after) {
    if (in_loop()) {
      action();
      return;
    }
    const auto call = std::make_shared<Call>(Command());
    std::unique_lock lock(mutex);
    if (closed) return;
    asio::post(io, [this, call, action = std::move(action), after = std::move(after)]() mutable {
      {
        const std::lock_guard begin_lock(mutex);
        if (call->abandoned) return;
        call->begun = true;
      }
      action();
      finish(*call, {});
      after();
    });
    const auto is_done = [&] { return call->done; };
    if (call->ended.wait_for(lock, default_timeout, is_done)) return;
    if (!call->begun) {
      call->abandoned = true;
      throw blocked_error(what, "not done");
    }
    call->ended.wait(lock, is_done);
  }
  template <class Action>
  void run_on_loop(std::string_view what, Action action) {
    run_on_loop(what, std::move(action), [] {});
  }

  // Installs a callback; then `tell` tells it what there is already.
  template <class Signature, class Tell>
  void install(std::string_view what, Callback<Signature>& place, std::function<Signature> callback,
               Tell tell) {
    run_on_loop(
        what,
        [self = shared_from_this(), &place, callback = std::move(callback)]() mutable {
          place.set(std::move(callback));
        },
        std::move(tell));
  }

  // Waits until `arrived` (asked under the lock) is true. False if it was not in time.
  template <class Predicate>
  bool wait_for_news(Duration timeout, Predicate arrived) {
    if (in_loop()) must_not_be_in_loop(name_now());  // a copy, which may need the heap
    std::unique_lock lock(mutex);
    const bool woken = news.wait_for(lock, bounded(timeout), [&] { return closed || arrived(); });
    if (closed) throw closed_error(name);
    return woken;
  }

  PostResult post(const Command& command) {
    require_sendable(command);
    const std::lock_guard lock(mutex);
    const bool stop = command.kind == CommandKind::stop;
    if (closed || (!in_control && !stop)) return PostResult::no_link;
    if (arming == Arming::required && disarmed_by != DisarmCause::none &&
        drives_output(command.kind)) {
      ++refused_here;
      return PostResult::not_armed;
    }
    return box.put(command) ? PostResult::sent : PostResult::queue_full;
  }

  void close() {
    if (in_loop()) {
      shut();
      return;
    }
    {
      const std::lock_guard lock(mutex);
      if (!closed) asio::post(io, [this] { shut(); });
    }
    const std::lock_guard joining(join_mutex);
    if (thread.joinable()) thread.join();
  }

  // The last a Board does. From a callback the loop's thread ends by itself, and Impl with it.
  void release() {
    close();
    if (!in_loop()) return;
    const std::lock_guard joining(join_mutex);
    if (thread.joinable()) thread.detach();
  }

  const Arming arming;
  asio::io_context io{1};
  asio::executor_work_guard<asio::io_context::executor_type> work{io.get_executor()};
  AsyncBoard async;
  PostBox box;
  std::thread thread;
  std::mutex join_mutex;

  // Of the loop.
  Callback<void(const ReceivedState&)> state_callback;
  Callback<void(const LinkStatus&)> link_callback;
  Callback<void(const CarrierEvent&)> event_callback;
  Callback<void()> restart_callback;
  Callback<void(DisarmCause)> arming_callback;
  Callback<void(const RefusedPost&)> refused_callback;
  std::optional<CarrierEvent> last_event;    // up or down
  std::optional<CarrierEvent> last_warning;  // since then

  const std::string url;  // as it was given

  // What both sides see.
  std::mutex mutex;
  std::condition_variable news;  // state, link or closed has changed
  std::string name;              // the transport's, as the loop knows it
  ReceivedState state;
  std::uint64_t states = 0;
  LinkStatus link;
  bool in_control = false;
  DisarmCause disarmed_by = DisarmCause::not_yet;
  std::uint64_t refused_here = 0;  // posts that did not get as far as the loop
  bool closed = false;
  Statistics last_statistics;
};

Board::Board(std::string_view url, BoardOptions options)
    : impl_(std::make_shared<Impl>(url, std::move(options))) {
  impl_->start();
}
Board::~Board() { impl_->release(); }

void Board::close() { impl_->close(); }

// A call holds the Impl, so that the Board may be destroyed while it waits.

void Board::wait_active(Duration timeout) {
  require_wait("wait_active()", timeout);
  const auto impl = impl_;
  const bool active = impl->wait_for_news(timeout, [&] {
    return impl->link.state == HostLinkState::active && impl->in_control && !impl->link.gated;
  });
  if (!active) throw Error(explain(impl->name_now(), impl->link_now()));
}

void Board::send(const Command& command, Duration timeout) {
  const auto impl = impl_;
  impl->require_sendable(command);
  if (command.kind == CommandKind::stop && timeout.count() <= 0) impl->post(command);
  require_timeout(shown(command), timeout);
  impl->execute(command, timeout);
}
void Board::send(std::string_view command, Duration timeout) {
  send(parse_command_text(command), timeout);
}
PostResult Board::post(const Command& command) { return impl_->post(command); }
void Board::arm(Duration timeout) {
  require_timeout("arm()", timeout);
  const auto impl = impl_;
  const auto call = std::make_shared<Impl::Call>(Command());
  call->arms = true;
  impl->execute("arm()", call, timeout);
}
DisarmCause Board::disarmed_by() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->disarmed_by;
}

void Board::stop(Duration timeout) { send(Command::stop(), timeout); }
void Board::stop_async() { impl_->post(Command::stop()); }
void Board::clear(Duration timeout) { send(Command::clear(), timeout); }

void Board::DriveChannel::set(int pwm, Direction direction, Duration timeout) const {
  board_.send(kind_ == CommandKind::osmc ? Command::osmc(pwm, direction, channel_)
                                         : Command::dhb12(pwm, direction, channel_),
              timeout);
}
void Board::ServoChannel::set(int pulse_us, Duration timeout) const {
  board_.send(Command::servo(pulse_us, channel_), timeout);
}
void Board::RelayChannel::set(bool on, Duration timeout) const {
  board_.send(Command::relay(channel_, on), timeout);
}
void Board::StepperChannel::move_to(std::int32_t position, int speed, Duration timeout) const {
  board_.send(Command::stepper(position, speed, channel_), timeout);
}
void Board::StepperChannel::zero(Duration timeout) const {
  board_.send(Command::zero(channel_), timeout);
}
void Board::BldcChannel::set(int speed, Direction direction, bool brake, Duration timeout) const {
  board_.send(Command::bldc(speed, direction, brake, channel_), timeout);
}
void Board::proximity(int channel, int threshold_cm, Duration timeout) {
  send(Command::proximity(threshold_cm, channel), timeout);
}
void Board::fields(std::string_view names, Duration timeout) {
  send("F:" + std::string(names), timeout);
}
void Board::setting(std::string_view key, std::string_view value, Duration timeout) {
  send("C:" + std::string(key) + "," + std::string(value), timeout);
}

void Board::link_timing(Duration board_timeout, Duration heartbeat, Duration timeout) {
  const std::string text = "C:timeout," + std::to_string(board_timeout.count()) + " C:heartbeat," +
                           std::to_string(heartbeat.count());
  require_timeout(text, timeout);
  const auto impl = impl_;
  impl->async.require_link_timing(board_timeout, heartbeat);
  const auto call = std::make_shared<Impl::Call>(Command());
  call->start = [&async = impl->async, board_timeout, heartbeat](Duration left, auto end) {
    async.async_link_timing(board_timeout, heartbeat, left, std::move(end));
  };
  impl->execute(text, call, timeout);
}

BoardIdentity Board::identify(Duration timeout) {
  require_timeout("identify()", timeout);
  const auto impl = impl_;
  return impl->execute(Command::identify(), timeout)->identity;
}

ReceivedState Board::state() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->state;
}
ReceivedState Board::next_state(Duration timeout) {
  require_timeout("next_state()", timeout);
  const auto impl = impl_;
  const std::uint64_t seen = impl->states_now();
  if (!impl->wait_for_news(timeout, [&] { return impl->states != seen; })) {
    Problem problem = explain(impl->name_now(), impl->link_now());
    problem.reason = "no state came in time: " + problem.reason;
    throw Error(std::move(problem));
  }
  const std::lock_guard lock(impl->mutex);
  return impl->state;
}
LinkStatus Board::link() const { return impl_->link_now(); }
std::string Board::name() const { return impl_->name_now(); }

Statistics Board::statistics() const {
  const auto impl = impl_;
  auto report = std::make_shared<Statistics>();
  {
    const std::lock_guard lock(impl->mutex);
    *report = impl->last_statistics;
  }
  impl->run_on_loop("statistics()", [impl, report] { *report = impl->async.statistics(); });
  const std::lock_guard lock(impl->mutex);
  report->refused += impl->refused_here;
  return *report;
}

void Board::on_state(std::function<void(const ReceivedState&)> callback) {
  const auto impl = impl_;
  impl->install("on_state()", impl->state_callback, std::move(callback), [impl = impl.get()] {
    if (impl->state.any()) impl->state_callback(impl->state);
  });
}
void Board::on_link(std::function<void(const LinkStatus&)> callback) {
  const auto impl = impl_;
  impl->install("on_link()", impl->link_callback, std::move(callback),
                [impl = impl.get()] { impl->link_callback(impl->link); });
}
void Board::on_event(std::function<void(const CarrierEvent&)> callback) {
  const auto impl = impl_;
  impl->install("on_event()", impl->event_callback, std::move(callback), [impl = impl.get()] {
    if (impl->last_event) impl->event_callback(*impl->last_event);
    if (impl->last_warning) impl->event_callback(*impl->last_warning);
  });
}
void Board::on_arming(std::function<void(DisarmCause)> callback) {
  const auto impl = impl_;
  impl->install("on_arming()", impl->arming_callback, std::move(callback),
                [impl = impl.get()] { impl->arming_callback(impl->async.disarmed_by()); });
}
void Board::on_refused(std::function<void(const RefusedPost&)> callback) {
  const auto impl = impl_;
  impl->install("on_refused()", impl->refused_callback, std::move(callback), [] {});
}
void Board::on_restart(std::function<void()> callback) {
  const auto impl = impl_;
  impl->install("on_restart()", impl->restart_callback, std::move(callback), [] {});
}

void Board::watchdog(Duration period) {
  require_watchdog(period);
  const auto impl = impl_;
  impl->run_on_loop("watchdog()", [impl = impl.get(), period] { impl->async.watchdog(period); });
}
void Board::feed() { impl_->async.feed(); }

}  // namespace r4
