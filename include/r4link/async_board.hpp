// SPDX-License-Identifier: GPL-3.0-or-later
// r4::AsyncBoard: a board for programs with an Asio loop.
//     asio::io_context io;
//     r4::AsyncBoard board(io, "serial:auto");       // or io.get_executor()
//     board.open();
//     board.async_send(r4::Command::osmc(1, r4::Pwm(358), r4::Direction::forward), 500ms,
//                      [](const r4::CommandResult& result) { … });
//     io.run();
//
// Call every function on the thread of the io_context, or before run(). Callbacks run on this
// thread. Only open() and close() may block: open() before run() waits up to 5 s for a host name,
// and both wait for a transport of your own (transports/own_transport.hpp).
//
// Completion tokens work: callbacks, asio::use_future, asio::use_awaitable. A handler runs on its
// associated executor, never inside the call that started it. A failed command is a result, not an
// exception: explain() (link.hpp) describes it. A handler's cancellation slot cancels the command:
// it is not sent again, but may have been executed. A cancelled stop continues; only the wait ends.
//
// Callbacks and handlers may call any function here and may destroy the board. An exception from a
// callback or handler leaves io.run(), as from any Asio handler. Reception and timers continue when
// run() is called again. In the steady state nothing is allocated.
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

  // Throws Error{usage} for a wrong URL. The io_context must outlive the board. '+' joins paths.
  AsyncBoard(const executor_type& executor, std::string_view url, BoardOptions options = {});
  AsyncBoard(asio::io_context& io, std::string_view url, BoardOptions options = {})
      : AsyncBoard(io.get_executor(), url, std::move(options)) {}
  // A board over one to four paths (docs/how-to/redundancy.md). Throws Error{usage} also for a
  // duplicate URL, and for sim: and replay:, which are separate boards.
  AsyncBoard(const executor_type& executor, const std::vector<std::string>& urls,
             BoardOptions options = {});
  AsyncBoard(asio::io_context& io, const std::vector<std::string>& urls, BoardOptions options = {})
      : AsyncBoard(io.get_executor(), urls, std::move(options)) {}
  AsyncBoard(asio::io_context& io, std::initializer_list<std::string_view> urls,
             BoardOptions options = {})
      : AsyncBoard(io.get_executor(), std::vector<std::string>(urls.begin(), urls.end()),
                   std::move(options)) {}
  // A board on a transport of your own, not yet open.
  AsyncBoard(const executor_type& executor, std::unique_ptr<Carrier> carrier,
             BoardOptions options = {});
  AsyncBoard(asio::io_context& io, std::unique_ptr<Carrier> carrier, BoardOptions options = {})
      : AsyncBoard(io.get_executor(), std::move(carrier), std::move(options)) {}
  AsyncBoard(const executor_type& executor, std::vector<std::unique_ptr<Carrier>> carriers,
             BoardOptions options = {});
  AsyncBoard(asio::io_context& io, std::vector<std::unique_ptr<Carrier>> carriers,
             BoardOptions options = {})
      : AsyncBoard(io.get_executor(), std::move(carriers), std::move(options)) {}
  ~AsyncBoard();
  AsyncBoard(const AsyncBoard&) = delete;
  AsyncBoard& operator=(const AsyncBoard&) = delete;

  executor_type get_executor() const noexcept;

  // The first heartbeat is sent at once. If a path cannot be opened, on_event() reports it, and the
  // path is tried again every second. Throws Error if no path can be opened. Call open() only once.
  void open();
  // Ends commands under way (outcome closed), sends one farewell and closes the transports. The
  // board goes safe at the farewell, or after its timeout. No callback follows. Idempotent.
  void close();
  // void(CommandResult). As close(), but repeats the farewell until the board answers. The board is
  // then free for another host. Confirmed: the outputs are safe, and no host controls the board.
  // Closed: this program did not control the board, or the board does not support the farewell. No
  // callback follows; a stop continues.
  template <class Token>
  auto async_close(Duration timeout, Token&& token) {
    require_timeout("async_close()", timeout);
    return initiate<&AsyncBoard::start_close, Token>(token, timeout);
  }

  BoardRole role() const;  // any thread
  // As Board::take_control(). Like async_release_control(), also throws Error{usage} if the board
  // is not open or control is being released.
  void take_control();
  // void(CommandResult). Disarms, cancels all commands except stops, and sends the farewell as
  // async_close() does. The program is always a watcher afterwards. Confirmed: the board is safe
  // and free, or the program was a watcher. Refused: another host controlled the board. Timed out:
  // the board goes safe after its timeout. None (no link, or a board without farewells): likewise.
  template <class Token>
  auto async_release_control(Duration timeout, Token&& token) {
    require_timeout("async_release_control()", timeout);
    require_role_settled("async_release_control()");
    return initiate<&AsyncBoard::start_release_control, Token>(token, timeout);
  }

  // Throws Error{usage} for a value out of range, and for a secret, except over the board's cable.
  void require_sendable(const Command& command) const;
  void require_sendable(const Setpoints& setpoints) const;

  // void(CommandResult). Throws as require_sendable(), and for a timeout that is not above 0. A
  // stop overtakes and cancels all commands, also before the link is up. Watchers may send a stop,
  // whose timeout may be 0. The board's answer confirms Command::identify(), and identity() returns
  // the answer. Command::clear() clears the reported stop, watchdog or fault.
  template <class Token>
  auto async_send(const Command& command, Duration timeout, Token&& token) {
    require_sendable(command);
    if (command.kind != CommandKind::stop) require_timeout("async_send()", timeout);
    return initiate<&AsyncBoard::start_send<Command>, Token>(token, command, timeout);
  }
  // void(CommandResult). As Board::send(); CommandResult::at and CommandResult::executed show which
  // command failed. Throws Error{usage} for an empty group, and for a timeout that is not above 0.
  template <class Token>
  auto async_send(const Setpoints& setpoints, Duration timeout, Token&& token) {
    require_sendable(setpoints);
    require_timeout("async_send()", timeout);
    return initiate<&AsyncBoard::start_send<Setpoints>, Token>(token, setpoints, timeout);
  }
  // void(CommandResult). As Board::arm(). Confirmed: output commands are sent. Not armed: the cause
  // cannot be cleared, or may be older than the program.
  template <class Token>
  auto async_arm(Duration timeout, Token&& token) {
    require_timeout("async_arm()", timeout);
    require_control("async_arm()");
    return initiate<&AsyncBoard::start_arm, Token>(token, timeout);
  }
  // void(CommandResult). Sends a Command::i2c_read(), i2c_write() or i2c_scan().
  // CommandResult::transfer is the device's answer. If the transfer failed: refused. Throws as
  // require_sendable(), and for another command or a timeout that is not above 0.
  template <class Token>
  auto async_transfer(const Command& command, Duration timeout, Token&& token) {
    require_sendable(command);
    require_timeout("async_transfer()", timeout);
    return initiate<&AsyncBoard::start_transfer, Token>(token, command, timeout);
  }

  // void(CommandResult). Confirmed when the board is ACTIVE and obeys this host; for a watcher,
  // when the link is active or safe. If the paths lead to two boards: refused. `timeout` may be 0.
  template <class Token>
  auto async_wait_active(Duration timeout, Token&& token) {
    require_wait("async_wait_active()", timeout);
    return initiate<&AsyncBoard::start_wait_active, Token>(token, timeout);
  }
  // void(CommandResult). As Board::link_timing(), with the same errors.
  template <class Token>
  auto async_link_timing(Duration board_timeout, Duration heartbeat, Duration timeout,
                         Token&& token) {
    require_timeout("async_link_timing()", timeout);
    require_control("async_link_timing()");
    require_link_timing(board_timeout, heartbeat);
    return initiate<&AsyncBoard::start_link_timing, Token>(token, board_timeout, heartbeat,
                                                           timeout);
  }
  // void(CommandResult). As Board::attach(), then describe(). Confirmed: device.reading() decodes
  // the values of each state. Otherwise explain(device, result, link()) describes the reason.
  template <class Token>
  auto async_attach(const Device& device, Duration timeout, Token&& token) {
    require_timeout("async_attach()", timeout);
    require_control("async_attach()");
    require_slots(device);
    return initiate<&AsyncBoard::start_attach, Token>(token, device, timeout);
  }
  // Throws Error{usage} for values that async_link_timing() cannot set.
  void require_link_timing(Duration board_timeout, Duration heartbeat) const;

  // Sends once, without confirmation. Returns why a command is not sent. on_refused() reports a
  // refusal of the board. A stop is sent as by async_send(), for 1 s. Throws Error{usage}.
  PostResult post(const Command& command);
  // For a board without groups, posts the commands one by one, up to the first unsent command.
  PostResult post(const Setpoints& setpoints);

  // The newest values; after close(), the last values.
  const ReceivedState& state() const;
  const LinkStatus& link() const;
  // True if the link is up and the board accepts this host's commands, which are sent at once.
  bool in_control() const;
  // Why output commands are refused; none if armed.
  DisarmCause disarmed_by() const;
  const BoardIdentity& identity() const;
  Statistics statistics() const;
  const CarrierCounters& carrier_counters() const;  // summed over all paths
  const std::string& name() const;                  // the names of all transports
  // The state of each path, in the order of the URLs.
  std::vector<PathStatus> paths() const;

  // Any number of callbacks of each kind, called in the order in which they were added. The handle
  // ends its callback. Unlike callbacks of Board, these receive only later events: read state(),
  // link() and disarmed_by() first. If the event loop was delayed by more than 50 ms, on_state()
  // reports only the newest waiting state. on_nack() reports each refusal once, but not DUPLICATE.
  Subscription on_state(std::function<void(const ReceivedState&, const Datagram&)> callback);
  Subscription on_board_heartbeat(std::function<void(const Datagram&)> callback);
  Subscription on_nack(std::function<void(const Nack&, const Datagram&)> callback);
  Subscription on_bad_datagram(std::function<void(const ReadResult&, std::string_view)> callback);
  // Datagrams of other programs to the board on a shared transport (docs/how-to/sharing.md):
  // heartbeats and commands of the controlling host, all stops. Dots replace secrets.
  Subscription on_overheard(std::function<void(std::string_view)> callback);
  Subscription on_link(std::function<void(const LinkStatus&)> callback);
  // Called when a path starts or stops carrying. If the transport reports that it is down, the call
  // is immediate, otherwise after the timeout of SessionOptions::timing.
  Subscription on_path(std::function<void(const PathStatus&)> callback);
  // Events of the transports, and a warning if a busy event loop delayed heartbeats.
  Subscription on_event(std::function<void(const CarrierEvent&)> callback);
  // As Board::on_restart(), on_arming() and on_refused().
  Subscription on_restart(std::function<void()> callback);
  Subscription on_arming(std::function<void(DisarmCause)> callback);
  Subscription on_refused(std::function<void(const RefusedPost&)> callback);

  void record(Recording& recording);
  // Names a device of this board in later recordings, so that r4 convert can decode it.
  void describe(const Device& device);

  // As Board::watchdog(). feed(): any thread; takes effect in the loop's next turn.
  void watchdog(Duration period);
  void feed();
  // True: holds back heartbeats and commands, so that the board goes safe. False: resumes both.
  void hold_heartbeats(bool held);

 private:
  struct Impl;

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

  // A completion handler of any type, until its command ends.
  class Completion {
   public:
    enum class How : std::uint8_t { dispatch, post };
    // Connects the handler's cancellation slot to `cancel`.
    virtual void listen(const Cancel& cancel) = 0;
    // Frees the memory, then passes the result to the handler's executor.
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

  template <auto Start, class Token, class... Arguments>
  auto initiate(std::remove_reference_t<Token>& token, const Arguments&... arguments) {
    auto start = [this](auto handler, const Arguments&... each) {
      (this->*Start)(each..., make_completion(std::move(handler)));
    };
    return asio::async_initiate<Token, void(CommandResult)>(start, token, arguments...);
  }

  // Throw Error{usage} for a time outside the valid range.
  static void require_timeout(std::string_view what, Duration timeout);
  static void require_wait(std::string_view what, Duration timeout);
  // Throws Error{usage} if the program is a watcher.
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

  class AttachSteps;
  std::shared_ptr<Impl> impl_;
};

// The loop of a Board's thread, for a transport with Asio objects.
asio::io_context& context_of(Loop& loop);

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
