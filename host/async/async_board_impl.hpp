// SPDX-License-Identifier: GPL-3.0-or-later
// The implementation of an AsyncBoard: a session, its paths, its timer, and the waits. Every call
// of the session is inside enter(), which then sends. The outermost enter() also reports and sets
// the timer. on_datagram() reports at once.
#pragma once

#include <asio/post.hpp>
#include <asio/steady_timer.hpp>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <memory>
#include <string_view>
#include <utility>
#include <vector>

#include "../session/session.hpp"
#include "../subscribers.hpp"
#include "backlog.hpp"
#include "board_path.hpp"
#include "r4link/async_board.hpp"
#include "r4link/control/boot_clock.hpp"
#include "waits.hpp"

namespace r4 {

// Outlives an AsyncBoard that a callback destroys. Larger than 15 members and 40 functions, because
// it implements every function of AsyncBoard.
struct AsyncBoard::Impl final : std::enable_shared_from_this<AsyncBoard::Impl> {
  using Path = BoardPath<Impl>;
  using Waits = r4::Waits<CompletionPtr>;
  class Sequence;
  template <class Next>
  class Steps;
  struct Callbacks {
    Subscribers<ReceivedState, Datagram> state;
    Subscribers<Datagram> heartbeat;
    Subscribers<Nack, Datagram> nack;
    Subscribers<ReadResult, std::string_view> bad;
    Subscribers<std::string_view> overheard;
    Subscribers<LinkStatus> link;
    Subscribers<PathStatus> path;
    Subscribers<CarrierEvent> event;
    Subscribers<> restart;
    Subscribers<DisarmCause> arming;
    Subscribers<RefusedPost> refused;
  };

  // From `leaving` on, the user receives no reports and cannot start commands.
  //     made --open()--> open --async_close()--> leaving --confirmed, or time is up--> closed
  //                        +-------------------- close() -------------------------------^
  enum class Phase : std::uint8_t { made, open, leaving, closed };
  bool is_open() const { return phase == Phase::open; }
  bool has_link() const { return phase == Phase::open || phase == Phase::leaving; }

  // Throws Error{usage} for no transport, and for more than Session::most_paths.
  Impl(asio::io_context& context, std::vector<std::unique_ptr<Carrier>> transports,
       BoardOptions options);

  static Time steady_now() {
    return std::chrono::duration_cast<Time>(std::chrono::steady_clock::now().time_since_epoch());
  }

  // Runs the user's code. An exception leaves io.run() from a separate handler: in a handler of the
  // transport it would end reception for ever.
  template <class Code>
  void guarded(Code code) {
    try {
      code();
    } catch (...) {
      asio::post(io, [error = std::current_exception()] { std::rethrow_exception(error); });
    }
  }
  template <class... Arguments>
  void call(const Subscribers<Arguments...>& those, const Arguments&... arguments) {
    those.each([&](auto& one) {
      // An earlier callback may have closed the board.
      if (is_open()) guarded([&] { one(arguments...); });
    });
  }
  void report(const CarrierEvent& event) {
    callbacks.event.each([&](auto& one) {
      if (is_open() || phase == Phase::made) guarded([&] { one(event); });
    });
  }
  void warn(Problem problem) { report({CarrierEvent::Kind::warning, std::move(problem)}); }

  template <class Action>
  void enter(Completion::How way, Action action) {
    const Time late = begin_entry(way);
    {
      const Inside inside(depth);
      if (depth == 1 && has_link() && sleep_watch.slept(now, board_timeout)) on_sleep();
      if (fed.load(std::memory_order_relaxed) != 0) {
        session.feed(Time{fed.exchange(0, std::memory_order_relaxed)});
      }
      action();
      send_all();
    }
    if (depth == 0) end_entry(late);
  }
  struct Inside {
    explicit Inside(int& d) : depth(d) { ++depth; }
    ~Inside() { --depth; }
    Inside(const Inside&) = delete;
    Inside& operator=(const Inside&) = delete;
    int& depth;
  };
  Time begin_entry(Completion::How way);
  void end_entry(Time late);
  void on_sleep();
  void send_all();
  void notify_all();
  bool end_waits();

  // `start` returns the command's ticket; if 0, the command ends as `not_taken`. `id`: the ticket
  // of the first step; 0 for the first step.
  template <class Start>
  void begin(CompletionPtr completion, Start start, Ticket id = 0,
             Outcome not_taken = Outcome::full) {
    enter(Completion::How::post, [&] {
      Ticket ticket = 0;
      try {
        if (is_open()) ticket = start();
      } catch (const Error&) {
        if (id == 0) throw;  // in a later step, control may be released
        not_taken = Outcome::cancelled;
      }
      if (ticket != 0) {
        if (id == 0) completion->listen(Cancel(weak_from_this(), id = ticket));
        waits.add(ticket, id, std::move(completion));
        poll_wanted = true;
      } else {
        const Outcome outcome = is_open() ? not_taken : Outcome::closed;
        completion.release()->complete({outcome, Refusal::none, Time{0}}, Completion::How::post);
      }
    });
  }
  template <class What>
  PostResult post(const What& what) {
    PostResult result = PostResult::no_link;
    enter(Completion::How::post, [&] {
      if (is_open()) result = post_by(session, what, now, [this] { send_all(); });
    });
    return result;
  }
  void cancel(Ticket id);
  void open();
  void open_path(Path& path);
  void report_trouble(Path& path) {
    on_carrier_event(path, {CarrierEvent::Kind::down, *path.trouble});
  }
  void open_again();
  // Sends a farewell. Returns its ticket; 0 if no board receives it.
  Ticket leave(Time timeout);
  void close();
  void become(BoardRole fresh);
  void cancel_waits();

  void name_in_recording();
  void describe(const Device& device);
  // X:OFF gives up the device with this slot.
  void give_up_slot(const Command& command);
  void give_up_slot(const Setpoints&) {}
  void warn_of_recordings();

  void arm();
  void on_timer();

  void on_datagram(Path& path, std::string_view bytes);
  void on_drained();
  void notify_backlog();
  void on_carrier_event(Path& path, const CarrierEvent& event);
  void on_overheard(Path& path, std::string_view bytes);

  SendResult transmit(const Sending& sending) const;
  void on_identity(const Identity& fresh);

  Carrier& carrier(std::size_t path) const { return *paths[path].carrier; }
  bool only_listens(std::size_t path) const;
  PathStatus status_of(std::size_t path) const;
  std::vector<PathStatus> statuses() const;
  void notify_paths(const LinkStatus& status);

  asio::io_context& io;
  BoardPaths<Impl> paths;
  std::vector<Device> devices;  // described in recordings
  std::vector<const Device*> attaching;
  std::uint32_t boots = 0;           // number of restarts of the board
  const std::uint32_t heartbeat_ms;  // interval of this host's heartbeats
  const Time board_timeout;
  Session session;
  BoardIdentity identity;

  Callbacks callbacks;
  Backlog backlog;
  Waits waits;
  SleepWatch sleep_watch;

  int depth = 0;  // calls of enter() and end_entry() under way
  bool poll_wanted = false;
  Completion::How how = Completion::How::post;
  Phase phase = Phase::made;
  std::atomic<BoardRole> role;  // the session's role, for any thread

  Time now{0};
  Time due{0};
  asio::steady_timer timer;
  asio::steady_timer reopening;
  LinkStatus reported;            // of the last report of paths
  Time armed_for = Time::max();   // when the timer expires; max(): never
  std::atomic<Time::rep> fed{0};  // the last feed(); 0: passed to the session
};

// The completion of a command with several steps, before the user's completion.
class AsyncBoard::Impl::Sequence : public Completion {
 public:
  Sequence(const Sequence&) = delete;
  Sequence& operator=(const Sequence&) = delete;
  void listen(const Cancel& cancel) final {
    id_ = cancel.command();
    completion_->listen(cancel);
  }
  void destroy() noexcept final { delete this; }

  // Begins a step. complete() receives its end.
  void send(const Command& command, Time timeout) {
    impl_.begin(
        CompletionPtr(this), [&] { return impl_.session.send(command, timeout, impl_.now); }, id_);
  }
  void wait(Waits::For what, std::uint32_t pnum, Time deadline) {
    impl_.enter(How::post, [&] {
      impl_.waits.add({what, id_, pnum, impl_.now, deadline, CompletionPtr(this)});
    });
  }
  // Destroys this, then passes the result to the user's handler.
  void end(CommandResult result, How called) {
    result.elapsed = steady_now() - started_;
    const CompletionPtr::pointer handler = completion_.release();
    delete this;
    handler->complete(result, called);
  }
  Impl& impl() const { return impl_; }

 protected:
  Sequence(Impl& impl, CompletionPtr completion)
      : impl_(impl), completion_(std::move(completion)) {}
  virtual ~Sequence() = default;

  Impl& impl_;  // owns this

 private:
  Ticket id_ = 0;  // of the first step; cancels all steps
  const Time started_ = steady_now();
  CompletionPtr completion_;
};

// A sequence in which next(sequence, result, how) begins the next step or calls end().
template <class Next>
class AsyncBoard::Impl::Steps final : public Sequence {
 public:
  Steps(Impl& impl, CompletionPtr completion, Next next)
      : Sequence(impl, std::move(completion)), next_(std::move(next)) {}
  void complete(const CommandResult& result, How called) override { next_(*this, result, called); }

 private:
  Next next_;
};

}  // namespace r4
