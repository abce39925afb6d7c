// SPDX-License-Identifier: GPL-3.0-or-later
// r4::AsyncBoard: a board for programs that have an Asio loop of their own.
//
//     asio::io_context io;
//     r4::AsyncBoard board(io, "serial:auto");       // or io.get_executor()
//     board.open();
//     board.async_send(r4::Command::osmc(1, r4::Pwm(358), r4::Direction::forward), 500ms,
//                      [](const r4::CommandResult& result) { … });
//     io.run();
//
// Everything happens on the io_context's thread: call it there, or before it runs; the callbacks
// come there. Completion tokens work: callbacks, asio::use_future, asio::use_awaitable; a handler
// runs on its associated executor, never inside the call that started it. A failure to execute a
// command is a result, not an exception: explain() (link.hpp) puts it into words. A handler's cancellation
// slot gives the command up: it ends as cancelled and is sent no more, though it may have been executed. A
// stop goes on all the same; only the wait for it ends.
//
// Callbacks and completion handlers may call anything here, destroy the board included. What one
// throws leaves io.run(), as from any handler of Asio, but never by way of the transport: reception
// and timers go on when run() is called again. The steady state allocates nothing.
#pragma once

#include <asio/associated_allocator.hpp>
#include <asio/associated_cancellation_slot.hpp>
#include <asio/associated_executor.hpp>
#include <asio/async_result.hpp>
#include <asio/cancellation_type.hpp>
#include <asio/dispatch.hpp>
#include <asio/executor_work_guard.hpp>
#include <asio/io_context.hpp>
#include <asio/post.hpp>
#include <asio/recycling_allocator.hpp>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <memory>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "carrier.hpp"
#include "datagram.hpp"
#include "devices/device.hpp"
#include "options.hpp"
#include "recording.hpp"
#include "setpoints.hpp"
#include "subscription.hpp"

namespace r4 {

class AsyncBoard {
 public:
  using Duration = std::chrono::milliseconds;
  using executor_type = asio::io_context::executor_type;

  // Throws Error{usage} for a wrong URL. The io_context must outlive the board. '+' joins several paths to it.
  AsyncBoard(const executor_type& executor, std::string_view url, BoardOptions options = {});
  AsyncBoard(asio::io_context& io, std::string_view url, BoardOptions options = {})
      : AsyncBoard(io.get_executor(), url, std::move(options)) {}
  // Over several paths at once, up to four, all to the same board (docs/redundancy.md). Throws Error{usage} also
  // for one that is there twice, and for sim: and replay:, which are boards of their own.
  AsyncBoard(const executor_type& executor, const std::vector<std::string>& urls,
             BoardOptions options = {});
  AsyncBoard(asio::io_context& io, const std::vector<std::string>& urls, BoardOptions options = {})
      : AsyncBoard(io.get_executor(), urls, std::move(options)) {}
  AsyncBoard(asio::io_context& io, std::initializer_list<std::string_view> urls,
             BoardOptions options = {})
      : AsyncBoard(io.get_executor(), std::vector<std::string>(urls.begin(), urls.end()),
                   std::move(options)) {}
  // The same on a transport of your own, not yet open.
  AsyncBoard(const executor_type& executor, std::unique_ptr<Carrier> carrier,
             BoardOptions options = {});
  AsyncBoard(asio::io_context& io, std::unique_ptr<Carrier> carrier, BoardOptions options = {})
      : AsyncBoard(io.get_executor(), std::move(carrier), std::move(options)) {}
  // On several.
  AsyncBoard(const executor_type& executor, std::vector<std::unique_ptr<Carrier>> carriers,
             BoardOptions options = {});
  AsyncBoard(asio::io_context& io, std::vector<std::unique_ptr<Carrier>> carriers,
             BoardOptions options = {})
      : AsyncBoard(io.get_executor(), std::move(carriers), std::move(options)) {}
  // Does what close() does.
  ~AsyncBoard();
  AsyncBoard(const AsyncBoard&) = delete;
  AsyncBoard& operator=(const AsyncBoard&) = delete;

  executor_type get_executor() const noexcept;

  // Opens the transport and begins the link: the first heartbeat goes out at once. Throws Error;
  // once only. Of several, one that cannot be opened yet is tried again every second, and on_event() tells why;
  // it throws if none can be.
  void open();
  // Cancels what is under way (outcome closed), says farewell once and closes the transport: the board
  // goes safe, when it has heard that or by its timeout. No callback follows. Idempotent; the board cannot
  // be opened again.
  void close();
  // void(CommandResult). The same, but repeats the farewell until the board has answered it, so that
  // another host finds the board free. Confirmed: its outputs are safe and nobody controls it. Closed: it
  // was not ours to leave, or does not know of farewells. No callback follows from the call on; stops that
  // are under way go on until then.
  template <class Token>
  auto async_close(Duration timeout, Token&& token) {
    require_timeout("async_close()", timeout);
    return initiate<&AsyncBoard::start_close, Token>(token, timeout);
  }

  BoardRole role() const;  // BoardOptions::role at first; may be called from any thread
  // Controls the board from now on, disarmed, as if it had been opened so. Callbacks, recordings
  // and what is known of the board stay. Throws Error{refused} if another program of this computer,
  // its holder(), controls the board: then this one watches on. Throws Error{usage} while the board
  // is not open, and, as async_release_control() does, while control is being released.
  void take_control();
  // void(CommandResult). Disarms, cancels all but stops, and says farewell as async_close() does.
  // However that ends, the program watches then. Confirmed: the board is safe and nobody controls
  // it, or the program watched already. Refused: another host had it. Timed out, and none (there
  // was no link, or the board knows no farewells): it goes safe by its timeout.
  template <class Token>
  auto async_release_control(Duration timeout, Token&& token) {
    require_timeout("async_release_control()", timeout);
    require_role_settled("async_release_control()");
    return initiate<&AsyncBoard::start_release_control, Token>(token, timeout);
  }

  // Throws Error{usage} for a command outside its ranges, and for a key or password where others
  // would see it.
  void require_sendable(const Command& command) const;
  void require_sendable(const Setpoints& setpoints) const;

  // void(CommandResult). Throws as require_sendable() does, and for a timeout of nothing.
  //
  // A stop overtakes and cancels everything, also before the link is up. It is sent whatever the
  // timeout, and by a watcher, too. Command::identify() is confirmed by the board's answer, which
  // identity() has. Command::clear() takes away the stop, watchdog or fault that the board reports.
  template <class Token>
  auto async_send(const Command& command, Duration timeout, Token&& token) {
    require_sendable(command);
    if (command.kind != CommandKind::stop) require_timeout("async_send()", timeout);
    return initiate<&AsyncBoard::start_send<Command>, Token>(token, command, timeout);
  }
  // void(CommandResult). Several output commands that the board executes together, in one pass over its chips,
  // or not at all; a board that knows no groups is sent one after the other, up to the first that fails:
  // CommandResult::at, executed. Throws Error{usage} for none, and for a timeout of nothing.
  template <class Token>
  auto async_send(const Setpoints& setpoints, Duration timeout, Token&& token) {
    require_sendable(setpoints);
    require_timeout("async_send()", timeout);
    return initiate<&AsyncBoard::start_send<Setpoints>, Token>(token, setpoints, timeout);
  }
  // void(CommandResult). Clears a stop, a watchdog or a fault that came while this program controlled
  // the board, and closes relay 1, the motor supply. Confirmed by the board's state: output commands
  // go out from then on. Not armed: what stands against it cannot be cleared, or may have come before
  // the program began, which Command::clear() clears.
  template <class Token>
  auto async_arm(Duration timeout, Token&& token) {
    require_timeout("async_arm()", timeout);
    require_control("async_arm()");
    return initiate<&AsyncBoard::start_arm, Token>(token, timeout);
  }
  // void(CommandResult). Sends a transfer on the user's I2C bus (Command::i2c_read(), i2c_write(),
  // i2c_scan()), and ends with the answer of the device: CommandResult::transfer. Refused also if
  // the transfer failed.
  template <class Token>
  auto async_transfer(const Command& command, Duration timeout, Token&& token) {
    require_sendable(command);
    require_timeout("async_transfer()", timeout);
    return initiate<&AsyncBoard::start_transfer, Token>(token, command, timeout);
  }

  // void(CommandResult). Confirmed as soon as the board is ACTIVE and takes our commands, so that the
  // first post() goes out, or, where the program only watches, as soon as it is heard; timed out, if it does not
  // come to that; refused, if the paths lead to two boards. A timeout of 0 only looks.
  template <class Token>
  auto async_wait_active(Duration timeout, Token&& token) {
    require_wait("async_wait_active()", timeout);
    return initiate<&AsyncBoard::start_wait_active, Token>(token, timeout);
  }
  // void(CommandResult). Sets the board's timeout and heartbeat interval together, whatever they are
  // now; one of them alone may be refused, for the interval must stay below the timeout. Throws
  // Error{usage} for values outside their ranges, and for a timeout that our own heartbeats
  // (SessionOptions::timing) cannot keep.
  template <class Token>
  auto async_link_timing(Duration board_timeout, Duration heartbeat, Duration timeout,
                         Token&& token) {
    require_timeout("async_link_timing()", timeout);
    require_control("async_link_timing()");
    require_link_timing(board_timeout, heartbeat);
    return initiate<&AsyncBoard::start_link_timing, Token>(token, board_timeout, heartbeat,
                                                           timeout);
  }
  // void(CommandResult). Sets a described device up as Board::attach() does, and describe()s it.
  // `timeout`: for each step. Confirmed: device.reading(state()) has its values from now on.
  // Otherwise explain(device, result, link()) says why.
  template <class Token>
  auto async_attach(const Device& device, Duration timeout, Token&& token) {
    require_timeout("async_attach()", timeout);
    require_control("async_attach()");
    require_slots(device);
    return initiate<&AsyncBoard::start_attach, Token>(token, device, timeout);
  }
  // Throws Error{usage} for what async_link_timing() cannot set.
  void require_link_timing(Duration board_timeout, Duration heartbeat) const;

  // Sends once, without confirmation, and says why it did not; on_refused() tells if the board refuses
  // it. A stop is sent as by async_send(), for a second. Throws Error{usage}.
  PostResult post(const Command& command);
  // The same of several that are executed together; where the board knows no groups, they are posted one by one,
  // up to the first that is not sent.
  PostResult post(const Setpoints& setpoints);

  // What is known now; after close(), what was known last.
  const ReceivedState& state() const;
  const LinkStatus& link() const;
  // The link is up and the board takes our commands: they go out at once.
  bool in_control() const;
  // Why the session is not armed; none if it is.
  DisarmCause disarmed_by() const;
  const BoardIdentity& identity() const;
  Statistics statistics() const;
  const CarrierCounters& carrier_counters() const;  // of several paths: of all together
  const std::string& name() const;                  // of several: all names
  // How each of its paths does, in the order of the URLs.
  std::vector<PathStatus> paths() const;

  // Any number of callbacks of each kind, called in the order in which they were added; the handle ends
  // one (subscription.hpp). Of the states that came while the event loop was held up for more than
  // 50 ms, on_state is told the newest alone. on_nack is told each refusal of a command once, and
  // not that a repeated command was a duplicate.
  Subscription on_state(std::function<void(const ReceivedState&, const Datagram&)> callback);
  Subscription on_board_heartbeat(std::function<void(const Datagram&)> callback);
  Subscription on_nack(std::function<void(const Nack&, const Datagram&)> callback);
  Subscription on_bad_datagram(std::function<void(const ReadResult&, std::string_view)> callback);
  // What other programs send to the board on a shared transport (docs/sharing.md): heartbeats and commands
  // of the controlling host, stops of any. Dots stand for a key or a password.
  Subscription on_overheard(std::function<void(std::string_view)> callback);
  Subscription on_link(std::function<void(const LinkStatus&)> callback);
  // A path has begun to carry, or ceased to. A transport that tells that it is gone is told of at
  // once, any other after SessionOptions::timing's timeout.
  Subscription on_path(std::function<void(const PathStatus&)> callback);
  // The transport, and a warning where the event loop was held up for so long that heartbeats were late.
  Subscription on_event(std::function<void(const CarrierEvent&)> callback);
  // The board has begun again, or this computer slept for longer than the board waits for its host:
  // what it was told is gone, thresholds of U too. Comes before its new state.
  Subscription on_restart(std::function<void()> callback);
  // The session is armed (none), or not any more.
  Subscription on_arming(std::function<void(DisarmCause)> callback);
  // The board refused a command that was posted.
  Subscription on_refused(std::function<void(const RefusedPost&)> callback);

  // Every datagram from now on, in both directions, goes into that recording too, until it is closed or gone, or
  // another one is named. Where it ends by itself on_event() tells, and the link goes on.
  void record(Recording& recording);
  // What the bytes of a device of this board mean, for recordings from now on: r4 convert tells its values.
  void describe(const Device& device);

  // Without feed() for `period` our heartbeats stop and the board goes safe; 0 turns it off. Throws
  // Error{usage} for less than nothing and more than an hour. feed() may be called from any thread,
  // costs no system call and counts from the next time the loop runs.
  void watchdog(Duration period);
  void feed();
  // Stops heartbeats and commands, so that the board goes safe, until it is called with false.
  void hold_heartbeats(bool held);

 private:
  friend class Fleet;  // its boards on a bus are stopped by one frame
  struct Impl;

  // Gives a command up that is under way, unless it has ended.
  class Cancel {
   public:
    Cancel(std::weak_ptr<Impl> impl, std::uint64_t command)
        : impl_(std::move(impl)), command_(command) {}
    void operator()(asio::cancellation_type type) const;
    std::uint64_t command() const { return command_; }

   private:
    std::weak_ptr<Impl> impl_;
    std::uint64_t command_;
  };

  // A completion handler of any type, kept until its command ends.
  class Completion {
   public:
    enum class How : std::uint8_t { dispatch, post };
    // Has the handler's cancellation slot give the command up.
    virtual void listen(const Cancel& cancel) = 0;
    // Frees the memory, then hands the result to the handler's executor.
    virtual void complete(const CommandResult& result, How how) = 0;
    virtual void destroy() noexcept = 0;

   protected:
    ~Completion() = default;
  };
  struct Destroy {
    void operator()(Completion* completion) const noexcept { completion->destroy(); }
  };
  using CompletionPtr = std::unique_ptr<Completion, Destroy>;

  template <class Handler>
  struct Bound;
  template <class Handler>
  class Typed;
  template <class Handler>
  CompletionPtr make_completion(Handler handler);

  // Starts what ends with a result for the token's handler.
  template <auto Start, class Token, class... Arguments>
  auto initiate(std::remove_reference_t<Token>& token, const Arguments&... arguments) {
    auto start = [this](auto handler, const Arguments&... each) {
      (this->*Start)(each..., make_completion(std::move(handler)));
    };
    return asio::async_initiate<Token, void(CommandResult)>(start, token, arguments...);
  }

  // Throw Error{usage} for a time that none can be.
  static void require_timeout(std::string_view what, Duration timeout);
  static void require_wait(std::string_view what, Duration timeout);
  // Throws Error{usage} for a program that only watches.
  void require_control(std::string_view what) const;
  template <class What>  // Command, Setpoints
  void start_send(const What& what, Duration timeout, CompletionPtr completion);
  void start_transfer(const Command& command, Duration timeout, CompletionPtr completion);
  void start_arm(Duration timeout, CompletionPtr completion);
  void start_wait_active(Duration timeout, CompletionPtr completion);
  void start_link_timing(Duration board_timeout, Duration heartbeat, Duration timeout,
                         CompletionPtr completion);
  void require_slots(const Device& device) const;
  void start_attach(const Device& device, Duration timeout, CompletionPtr completion);
  void start_close(Duration timeout, CompletionPtr completion);
  void require_role_settled(std::string_view what) const;
  void start_release_control(Duration timeout, CompletionPtr completion);

  class TimingSteps;
  class TransferSteps;
  class AttachSteps;
  class Farewell;
  std::shared_ptr<Impl> impl_;
};

// The loop of a Board's thread, for a transport that is made of Asio's objects.
asio::io_context& context_of(Loop& loop);

// --- implementation of the templates

// A handler with its argument, as Asio wants it.
template <class Handler>
struct AsyncBoard::Bound {
  using allocator_type = asio::associated_allocator_t<Handler, asio::recycling_allocator<void>>;
  allocator_type get_allocator() const noexcept {
    return asio::get_associated_allocator(handler, asio::recycling_allocator<void>());
  }
  void operator()() { std::move(handler)(result); }

  Handler handler;
  CommandResult result;
};

template <class Handler>
class AsyncBoard::Typed final : public Completion {
  using Executor = asio::associated_executor_t<Handler, executor_type>;
  using Allocator = typename std::allocator_traits<
      typename Bound<Handler>::allocator_type>::template rebind_alloc<Typed>;
  using Traits = std::allocator_traits<Allocator>;

 public:
  static CompletionPtr make(Handler handler, const executor_type& loop) {
    Allocator allocator = allocator_of(handler);
    Typed* place = Traits::allocate(allocator, 1);
    return CompletionPtr(new (place) Typed(std::move(handler), loop));
  }

  void listen(const Cancel& cancel) override {
    auto slot = asio::get_associated_cancellation_slot(handler_);
    if (slot.is_connected()) slot.assign(cancel);
  }
  void complete(const CommandResult& result, How how) override {
    ignore_cancellation();
    Allocator allocator = allocator_of(handler_);
    const auto work = std::move(work_);
    Bound<Handler> bound{std::move(handler_), result};
    free(allocator);
    if (how == How::dispatch) {
      asio::dispatch(work.get_executor(), std::move(bound));
    } else {
      asio::post(work.get_executor(), std::move(bound));
    }
  }
  void destroy() noexcept override {
    ignore_cancellation();
    Allocator allocator = allocator_of(handler_);
    free(allocator);
  }

 private:
  Typed(Handler handler, const executor_type& loop)
      : handler_(std::move(handler)), work_(asio::get_associated_executor(handler_, loop)) {}
  ~Typed() = default;

  void ignore_cancellation() noexcept {
    auto slot = asio::get_associated_cancellation_slot(handler_);
    if (slot.is_connected()) slot.clear();
  }
  static Allocator allocator_of(const Handler& handler) noexcept {
    return Allocator(asio::get_associated_allocator(handler, asio::recycling_allocator<void>()));
  }
  void free(Allocator& allocator) noexcept {
    this->~Typed();
    Traits::deallocate(allocator, this, 1);
  }

  Handler handler_;
  asio::executor_work_guard<Executor> work_;
};

template <class Handler>
AsyncBoard::CompletionPtr AsyncBoard::make_completion(Handler handler) {
  return Typed<Handler>::make(std::move(handler), get_executor());
}

}  // namespace r4
