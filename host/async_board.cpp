// SPDX-License-Identifier: GPL-3.0-or-later
#include "async_board.hpp"

#include <algorithm>
#include <array>
#include <asio/steady_timer.hpp>
#include <atomic>
#include <exception>
#include <utility>
#include <vector>

#include "../transports/registry.hpp"
#include "session/link_timing.hpp"

namespace r4 {

namespace {

Time steady_now() {
  return std::chrono::duration_cast<Time>(std::chrono::steady_clock::now().time_since_epoch());
}

// The session counts from the steady clock; since 1970 it is this much more.
SessionOptions with_clock(SessionOptions options) {
  const auto epoch = std::chrono::system_clock::now().time_since_epoch();
  options.clock_start = std::chrono::duration_cast<Time>(epoch) - steady_now();
  return options;
}

// Not in the event loop for this long: what has come meanwhile is a backlog, and of its states only
// the newest is told.
constexpr Time held_up{std::chrono::milliseconds{50}};
// What was due so long ago is told of: two heartbeats were late.
constexpr Time very_late{std::chrono::milliseconds{200}};

// A day is as good as for ever, and cannot overflow.
Time time_of(AsyncBoard::Duration timeout) {
  return std::clamp<AsyncBoard::Duration>(timeout, AsyncBoard::Duration{0}, std::chrono::hours{24});
}

}  // namespace

// Outlives the AsyncBoard where a callback or handler destroys that.
struct AsyncBoard::Impl final : Carrier::Handler,
                                Session::Handler,
                                std::enable_shared_from_this<AsyncBoard::Impl> {
  // A command under way, and one that has ended.
  struct Waiting {
    Ticket ticket = 0;
    CompletionPtr completion;
  };
  // Who waits until the board is active.
  struct Waiter {
    Time started{0};
    Time deadline{0};
    CompletionPtr completion;
  };
  struct Ended {
    CommandResult result;
    CompletionPtr completion;
  };

  Impl(asio::io_context& context, std::unique_ptr<Carrier> transport, BoardOptions options)
      : io(context),
        carrier(std::move(transport)),
        heartbeat_ms(options.session.timing.heartbeat_ms),
        session(*this, with_clock(std::move(options.session)), Session::random_first_pnum()),
        timer(context) {
    waiting.reserve(Session::max_pending + Session::max_stops);
    ended.reserve(Session::max_pending + Session::max_stops);
  }

  // --- entering the session

  // Runs the user's code. What it throws leaves io.run() in a handler of its own: through the
  // transport, whose handler may be below us, it would end reception for ever.
  template <class Code>
  void guarded(Code code) {
    try {
      code();
    } catch (...) {
      asio::post(io, [error = std::current_exception()] { std::rethrow_exception(error); });
    }
  }
  template <class... Arguments>
  void call(const Subscribers<Arguments...>& callbacks, const Arguments&... arguments) {
    callbacks.each([&](auto& one) { guarded([&] { one(arguments...); }); });
  }

  // Every call of the session is made in here. The outermost one tells the results and sets the
  // timer afterwards; so no handler runs inside the session, or inside the call that started its
  // command.
  template <class Action>
  void enter(Completion::How way, Action action) {
    if (depth == 0) how = way;
    const Time before = std::exchange(now, steady_now());
    if (now - before > held_up) in_backlog = true;
    const Time late = is_open && depth == 0 ? now - due : Time{0};
    {
      const Inside inside(depth);
      if (fed.load(std::memory_order_relaxed) != 0) {
        session.feed(Time{fed.exchange(0, std::memory_order_relaxed)});
      }
      action();
    }
    if (depth != 0) return;
    if (is_open && late > very_late) tell_that_it_was_held_up(late);
    settle();
  }
  void tell_that_it_was_held_up(Time late) {
    const Inside inside(depth);
    const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(late).count();
    call(event_callbacks,
         CarrierEvent{CarrierEvent::Kind::warning,
                      Problem{ErrorKind::refused, "the event loop",
                              "it was held up: what was due went out " + std::to_string(ms) +
                                  " ms late, heartbeats too",
                              "a handler must return at once; do the work in another thread"}});
  }
  struct Inside {
    explicit Inside(int& d) : depth(d) { ++depth; }
    ~Inside() { --depth; }
    Inside(const Inside&) = delete;
    Inside& operator=(const Inside&) = delete;
    int& depth;
  };

  void settle() {
    const Inside inside(depth);
    for (;;) {
      // Handlers that are dispatched may start commands, whose ends are appended.
      while (!ended.empty()) {
        Ended first = std::move(ended.front());
        ended.erase(ended.begin());
        guarded([&] { first.completion.release()->complete(first.result, how); });
      }
      if (poll_wanted && is_open) {
        poll_wanted = false;
        due = session.poll(now);
      } else if (!end_waits()) {
        break;
      }
    }
    if (is_open) arm();
  }

  // Ends the waits that are over; false if none is.
  bool end_waits() {
    const LinkStatus& link = session.link();
    const bool active = link.state == HostLinkState::active && link.in_control;
    bool any = false;
    for (std::size_t i = 0; i < waiters.size();) {
      Waiter& waiter = waiters[i];
      const Outcome outcome = !is_open ? Outcome::closed   
                              : active ? Outcome::confirmed
                                       : Outcome::timed_out;
      if (outcome == Outcome::timed_out && now < waiter.deadline) {
        ++i;
        continue;
      }
      any = true;
      ended.push_back(
          {{outcome, Refusal::none, now - waiter.started}, std::move(waiter.completion)});
      waiters.erase(waiters.begin() + static_cast<std::ptrdiff_t>(i));
    }
    return any;
  }

  // --- time

  // The timer is only set when it must ring earlier than it will; ringing early costs one poll.
  void arm() {
    Time next = due;
    for (const Waiter& waiter : waiters) next = std::min(next, waiter.deadline);
    if (armed && armed_for <= next) return;
    armed = true;
    armed_for = next;
    timer.expires_at(std::chrono::steady_clock::time_point(next));
    timer.async_wait([self = shared_from_this()](const std::error_code& error) {
      if (!error) self->on_timer();
    });
  }
  void on_timer() {
    if (!is_open) return;
    armed = false;
    enter(Completion::How::dispatch, [this] { due = session.poll(now); });
  }

  // --- Carrier::Handler

  void on_datagram(std::string_view bytes, Peer) override {
    enter(Completion::How::dispatch, [&] {
      session.receive(bytes, now);
      poll_wanted = true;
    });
  }
  void on_drained() override {
    in_backlog = false;
    if (backlog_size == 0) return;
    const std::size_t size = std::exchange(backlog_size, 0);
    enter(Completion::How::dispatch, [&] {
      Datagram datagram;
      if (is_open && read(Text(backlog.data(), size), datagram)) {
        call(state_callbacks, session.state(), datagram);
      }
    });
  }
  void on_carrier_event(const CarrierEvent& event) override {
    enter(Completion::How::dispatch, [&] {
      call(event_callbacks, event);
      if (event.kind != CarrierEvent::Kind::warning) {
        session.on_transport(event.kind == CarrierEvent::Kind::up, now);
      }
      poll_wanted = true;
    });
  }

  // --- Session::Handler

  SendResult transmit(std::string_view datagram, Priority priority) override {
    return is_open ? carrier->send(datagram, priority) : SendResult::down;
  }
  void on_state(const ReceivedState& state, const Datagram& datagram) override {
    if (!is_open) return;
    if (in_backlog) {
      backlog_size = datagram.bytes().size();
      std::copy_n(datagram.bytes().data(), backlog_size, backlog.data());
    } else {
      call(state_callbacks, state, datagram);
    }
  }
  void on_board_heartbeat(const Datagram& datagram) override {
    if (is_open) call(heartbeat_callbacks, datagram);
  }
  void on_identity(const Identity& fresh) override {
    identity.firmware.assign(fresh.firmware.data(), fresh.firmware.size());
    identity.board_id.assign(fresh.board_id.data(), fresh.board_id.size());
    identity.capabilities.assign(fresh.capabilities.data(), fresh.capabilities.size());
  }
  void on_nack(const Nack& nack, const Datagram& datagram) override {
    if (is_open) call(nack_callbacks, nack, datagram);
  }
  void on_bad_datagram(const ReadResult& result, std::string_view bytes) override {
    if (is_open) call(bad_callbacks, result, bytes);
  }
  void on_link(const LinkStatus& status) override {
    if (is_open) call(link_callbacks, status);
  }
  void on_restart() override {
    backlog_size = 0;  // of the boot before
    if (is_open) call(restart_callbacks);
  }
  void on_arming(DisarmCause cause) override {
    if (is_open) call(arming_callbacks, cause);
  }
  void on_refused(const RefusedPost& refused) override {
    if (is_open) call(refused_callbacks, refused);
  }
  void on_result(Ticket ticket, const CommandResult& result) override {
    const auto found = std::find_if(waiting.begin(), waiting.end(),
                                    [ticket](const Waiting& w) { return w.ticket == ticket; });
    if (found == waiting.end()) return;
    ended.push_back({result, std::move(found->completion)});
    if (found != waiting.end() - 1) *found = std::move(waiting.back());
    waiting.pop_back();
  }

  // --- what the user starts

  // `start` hands the command to the session; its ticket is 0 if there is no room.
  template <class Start>
  void begin(CompletionPtr completion, Start start) {
    enter(Completion::How::post, [&] {
      const Ticket ticket = is_open ? start() : 0;
      if (ticket != 0) {
        waiting.push_back({ticket, std::move(completion)});
        poll_wanted = true;
      } else {
        const Outcome outcome = is_open ? Outcome::full : Outcome::closed;
        completion.release()->complete({outcome, Refusal::none, Time{0}}, Completion::How::post);
      }
    });
  }

  void open() {
    if (is_open || closed) {
      throw Error(ErrorKind::usage, carrier->name(), "a board is opened once",
                  "make another one for the same URL");
    }
    carrier->open(*this);
    if (closed) return;  // by the callback that was told that it is open
    is_open = true;
    enter(Completion::How::post, [this] { due = session.poll(now); });
  }
  void close() {
    if (closed) return;
    closed = true;
    is_open = false;
    carrier->close();
    timer.cancel();
    how = Completion::How::post;
    enter(Completion::How::post, [this] { session.end_all(now); });
  }

  asio::io_context& io;
  std::unique_ptr<Carrier> carrier;
  const std::uint32_t heartbeat_ms;  // between ours
  Session session;
  BoardIdentity identity;

  Subscribers<ReceivedState, Datagram> state_callbacks;
  Subscribers<Datagram> heartbeat_callbacks;
  Subscribers<Nack, Datagram> nack_callbacks;
  Subscribers<ReadResult, std::string_view> bad_callbacks;
  Subscribers<LinkStatus> link_callbacks;
  Subscribers<CarrierEvent> event_callbacks;
  Subscribers<> restart_callbacks;
  Subscribers<DisarmCause> arming_callbacks;
  Subscribers<RefusedPost> refused_callbacks;

  bool in_backlog = false;
  std::array<char, max_datagram> backlog;  // the newest state of it
  std::size_t backlog_size = 0;

  std::vector<Waiting> waiting;
  std::vector<Ended> ended;
  std::vector<Waiter> waiters;
  int depth = 0;  // calls of enter() and settle() under way
  bool poll_wanted = false;
  Completion::How how = Completion::How::post;
  bool is_open = false;
  bool closed = false;

  Time now{0};
  Time due{0};
  asio::steady_timer timer;
  bool armed = false;
  Time armed_for{0};
  std::atomic<Time::rep> fed{0};  // when feed() was called last; 0: the session knows it
};

AsyncBoard::AsyncBoard(asio::io_context& io, std::string_view url, BoardOptions options)
    : AsyncBoard(io, standard_registry().make(io, url, Role::host), std::move(options)) {}

AsyncBoard::AsyncBoard(asio::io_context& io, std::unique_ptr<Carrier> carrier, BoardOptions options)
    : impl_(std::make_shared<Impl>(io, std::move(carrier), std::move(options))) {}

AsyncBoard::~AsyncBoard() {
  impl_->close();
  // Inside a callback the transport is still running: it goes when that is over.
  if (impl_->depth > 0) asio::post(impl_->io, [keep = impl_] {});
}

void AsyncBoard::open() { impl_->open(); }
void AsyncBoard::close() { impl_->close(); }

asio::io_context::executor_type AsyncBoard::executor() const { return impl_->io.get_executor(); }

void AsyncBoard::start_send(const Command& command, Duration timeout, CompletionPtr completion) {
  Impl& impl = *impl_;
  impl.begin(std::move(completion),
             [&] { return impl.session.send(command, time_of(timeout), impl.now); });
}

void AsyncBoard::start_stop(Duration timeout, CompletionPtr completion) {
  Impl& impl = *impl_;
  impl.begin(std::move(completion), [&] { return impl.session.stop(time_of(timeout), impl.now); });
}

void AsyncBoard::start_arm(Duration timeout, CompletionPtr completion) {
  Impl& impl = *impl_;
  impl.begin(std::move(completion), [&] { return impl.session.arm(time_of(timeout), impl.now); });
}

void AsyncBoard::start_identify(Duration timeout, CompletionPtr completion) {
  Impl& impl = *impl_;
  impl.begin(std::move(completion),
             [&] { return impl.session.identify(time_of(timeout), impl.now); });
}

void AsyncBoard::start_wait_active(Duration timeout, CompletionPtr completion) {
  Impl& impl = *impl_;
  impl.enter(Completion::How::post, [&] {
    impl.waiters.push_back({impl.now, impl.now + time_of(timeout), std::move(completion)});
  });
}

// Sets one setting after the other; the user's completion is told how the last ended.
class AsyncBoard::TimingSteps final : public Completion {
 public:
  TimingSteps(Impl& impl, LinkTimingSteps steps, Time timeout, CompletionPtr completion)
      : impl_(impl),
        steps_(steps),
        started_(steady_now()),
        deadline_(started_ + timeout),
        completion_(std::move(completion)) {}

  static void begin(std::unique_ptr<TimingSteps, Destroy> self) {
    TimingSteps& steps = *self;
    steps.impl_.begin(std::move(self), [&steps] {
      const LinkTimingStep& step = steps.steps_[steps.done_];
      const std::string value = std::to_string(step.ms);
      const Time left = std::max(Time{0}, steps.deadline_ - steps.impl_.now);
      return steps.impl_.session.send(Command::setting(step.key, Text(value)), left,
                                      steps.impl_.now);
    });
  }

  void complete(const CommandResult& result, How how) override {
    std::unique_ptr<TimingSteps, Destroy> self(this);
    if (result.outcome == Outcome::confirmed && ++done_ < steps_.count) {
      begin(std::move(self));
      return;
    }
    CommandResult whole = result;
    whole.elapsed = steady_now() - started_;
    const CompletionPtr::pointer users = completion_.release();
    self.reset();
    users->complete(whole, how);
  }
  void destroy() noexcept override { delete this; }

 private:
  Impl& impl_;  // which owns this
  LinkTimingSteps steps_;
  std::size_t done_ = 0;
  Time started_, deadline_;
  CompletionPtr completion_;
};

void AsyncBoard::require_link_timing(Duration board_timeout, Duration heartbeat) const {
  r4::require_link_timing(board_timeout, heartbeat, Duration{impl_->heartbeat_ms});
}

void AsyncBoard::start_link_timing(Duration board_timeout, Duration heartbeat, Duration timeout,
                                   CompletionPtr completion) {
  TimingSteps::begin(std::unique_ptr<TimingSteps, Destroy>(
      new TimingSteps(*impl_, link_timing_steps(board_timeout, heartbeat), time_of(timeout),
                      std::move(completion))));
}

void AsyncBoard::require_sendable(const Command& command) const {
  require_valid(command);
  require_cable(name(), command);
}

PostResult AsyncBoard::post(const Command& command) {
  require_sendable(command);
  Impl& impl = *impl_;
  PostResult result = PostResult::no_link;
  impl.enter(Completion::How::post, [&] {
    if (impl.is_open) result = impl.session.post(command, impl.now);
  });
  return result;
}

const ReceivedState& AsyncBoard::state() const { return impl_->session.state(); }
const LinkStatus& AsyncBoard::link() const { return impl_->session.link(); }
bool AsyncBoard::in_control() const {
  return impl_->is_open && impl_->session.in_control(steady_now());
}
DisarmCause AsyncBoard::disarmed_by() const { return impl_->session.disarmed_by(); }
const BoardIdentity& AsyncBoard::identity() const { return impl_->identity; }
Statistics AsyncBoard::statistics() const { return impl_->session.statistics(steady_now()); }
const CarrierCounters& AsyncBoard::carrier_counters() const { return impl_->carrier->counters(); }
const std::string& AsyncBoard::name() const { return impl_->carrier->name(); }

Subscription AsyncBoard::on_state(std::function<void(const ReceivedState&, const Datagram&)> callback) {
  return impl_->state_callbacks.add(std::move(callback));
}
Subscription AsyncBoard::on_board_heartbeat(std::function<void(const Datagram&)> callback) {
  return impl_->heartbeat_callbacks.add(std::move(callback));
}
Subscription AsyncBoard::on_nack(std::function<void(const Nack&, const Datagram&)> callback) {
  return impl_->nack_callbacks.add(std::move(callback));
}
Subscription AsyncBoard::on_bad_datagram(std::function<void(const ReadResult&, std::string_view)> callback) {
  return impl_->bad_callbacks.add(std::move(callback));
}
Subscription AsyncBoard::on_link(std::function<void(const LinkStatus&)> callback) {
  return impl_->link_callbacks.add(std::move(callback));
}
Subscription AsyncBoard::on_event(std::function<void(const CarrierEvent&)> callback) {
  return impl_->event_callbacks.add(std::move(callback));
}
Subscription AsyncBoard::on_restart(std::function<void()> callback) {
  return impl_->restart_callbacks.add(std::move(callback));
}
Subscription AsyncBoard::on_arming(std::function<void(DisarmCause)> callback) {
  return impl_->arming_callbacks.add(std::move(callback));
}
Subscription AsyncBoard::on_refused(std::function<void(const RefusedPost&)> callback) {
  return impl_->refused_callbacks.add(std::move(callback));
}

void AsyncBoard::watchdog(Duration period) {
  require_watchdog(period);
  Impl& impl = *impl_;
  impl.enter(Completion::How::post, [&] {
    impl.session.watchdog(period, impl.now);
    impl.poll_wanted = true;
  });
}

void AsyncBoard::hold_heartbeats(bool held) {
  Impl& impl = *impl_;
  impl.enter(Completion::How::post, [&] {
    impl.session.hold(held, impl.now);
    impl.poll_wanted = true;
  });
}

void AsyncBoard::feed() { impl_->fed.store(steady_now().count(), std::memory_order_relaxed); }

}  // namespace r4
