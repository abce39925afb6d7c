// SPDX-License-Identifier: GPL-3.0-or-later
// What is behind an AsyncBoard: a session, its paths and its timer, and who waits for what.
//
// Every call of the session is made inside enter(), which then sends what the session wants to be sent. The
// outermost enter() also reports events and results, and sets the timer. on_datagram() reports at once.
#pragma once

#include <array>
#include <asio/post.hpp>
#include <asio/steady_timer.hpp>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "../measurement/boot_clock.hpp"
#include "../session/session.hpp"
#include "../subscribers.hpp"
#include "backlog.hpp"
#include "board_path.hpp"
#include "r4link/async_board.hpp"
#include "waits.hpp"

namespace r4 {

// Outlives the AsyncBoard where a callback or handler destroys that.
//
// It has more than 15 members and 40 functions, because every function of AsyncBoard ends here and each
// kind of event has a function of its own. A job of its own has a class: Session, BoardPaths, Waits,
// Backlog.
struct AsyncBoard::Impl final : BoardPath::Owner, std::enable_shared_from_this<AsyncBoard::Impl> {
  using Waits = r4::Waits<CompletionPtr>;
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

  // The user is told nothing, and starts nothing, from `leaving` on.
  //
  //     made --open()--> open --async_close()--> leaving --the board knows it, or time is up--> closed
  //                        +-------------------- close() ----------------------------------------^
  enum class Phase : std::uint8_t { made, open, leaving, closed };
  bool is_open() const { return phase == Phase::open; }
  bool has_link() const { return phase == Phase::open || phase == Phase::leaving; }
  bool may_tell() const { return phase == Phase::made || phase == Phase::open; }

  // Throws Error{usage} for none, and for more than a session has.
  Impl(asio::io_context& context, std::vector<std::unique_ptr<Carrier>> transports,
       BoardOptions options);

  static Time steady_now() {
    return std::chrono::duration_cast<Time>(std::chrono::steady_clock::now().time_since_epoch());
  }
  // A day is as good as for ever, and cannot overflow.
  static Time time_of(Duration timeout);

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
  void call(const Subscribers<Arguments...>& those, const Arguments&... arguments) {
    those.each([&](auto& one) {
      // The one before may have closed the board.
      if (may_tell()) guarded([&] { one(arguments...); });
    });
  }

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
  void tell_that_it_was_held_up(Time late);
  void send_all();
  void notify_all();
  void settle();
  bool end_waits();

  // --- what the user starts

  // `start` hands the command to the session; its ticket is 0 if it is not taken, and ends so.
  // `id`: of the step before, if it is not the first.
  template <class Start>
  void begin(CompletionPtr completion, Start start, Ticket id = 0,
             Outcome not_taken = Outcome::full) {
    enter(Completion::How::post, [&] {
      Ticket ticket = 0;
      try {
        if (is_open()) ticket = start();
      } catch (const Error&) {
        if (id == 0) throw;  // a later step: control may have been released since
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
  // A command, or a group.
  template <class What>
  PostResult post(const What& what) {
    return post_by(session, what, now, [this] { send_all(); });
  }
  void wait_active(Duration timeout, CompletionPtr completion);
  bool has_come(const Waits::Condition& condition) const;
  void cancel(Ticket id);
  void open();
  bool open_path(BoardPath& path, std::optional<Problem>& problem);
  void tell_trouble(BoardPath& path) {
    on_carrier_event(path, {CarrierEvent::Kind::down, *path.trouble});
  }
  void open_again();
  // Says farewell: its ticket, or 0 if there is nobody to say it to.
  Ticket leave(Time timeout);
  void close();
  void become(BoardRole role);
  // Conditions that a program waits for end, because control is released.
  void cancel_waits();

  void record(const std::shared_ptr<Recorder>& recorder);
  void name_in_recording();
  void describe(const Device& device);
  void describe_in_recording(const Device& device);
  // Throws Error{usage} if another device has one of its slots.
  void require_slots(const Device& device) const;
  // X:OFF gives up the device that has that slot.
  void give_up_slot(const Command& command);
  void tell_of_recordings();

  // --- time

  void arm();
  void on_timer();

  // --- BoardPath::Owner

  void on_datagram(BoardPath& path, std::string_view bytes) override;
  void on_drained() override;
  void notify_backlog();
  void on_carrier_event(BoardPath& path, const CarrierEvent& event) override;
  void on_overheard(BoardPath& path, std::string_view bytes) override;

  // --- what the session wants done

  SendResult transmit(const Sending& sending) const;
  void notify(const StateCame&);
  void notify(const HeartbeatCame&);
  void notify(const BoardIdentified& event);
  void notify(const CommandRefused& event);
  void notify(const BadDatagramCame& event);
  void notify(const LinkChanged& event);
  void notify(const CommandEnded& event);
  void notify(const BoardRestarted&);
  void notify(const ArmingChanged&);
  void notify(const PostRefused& event);

  // --- the paths

  Carrier& carrier(std::size_t path) const { return *paths[path].carrier; }
  bool only_listens(std::size_t path) const;
  PathStatus report(std::size_t path) const;
  void notify_paths(const LinkStatus& status);

  asio::io_context& io;
  BoardPaths paths;
  std::vector<Device> devices;  // that recordings tell of
  std::vector<const Device*> attaching;
  std::uint32_t boots = 0;           // of the board, while we have known it
  const std::uint32_t heartbeat_ms;  // between ours
  const Time board_timeout;          // so long a board waits for its host
  Session session;
  BoardIdentity identity;

  Callbacks callbacks;
  Backlog backlog;
  Waits waits;
  SleepWatch sleep_watch;

  int depth = 0;  // calls of enter() and settle() under way
  bool poll_wanted = false;
  Completion::How how = Completion::How::post;
  Phase phase = Phase::made;

  Time now{0};
  Time due{0};
  asio::steady_timer timer;
  asio::steady_timer reopening;
  LinkStatus told;  // the status that paths were reported by last
  bool armed = false;
  Time armed_for{0};
  std::atomic<Time::rep> fed{0};  // when feed() was called last; 0: the session knows it
};

}  // namespace r4
