// SPDX-License-Identifier: GPL-3.0-or-later
// r4::AsyncBoard: a board for programs that have an Asio loop of their own.
//
//     asio::io_context io;
//     r4::AsyncBoard board(io, "serial:auto");
//     board.open();
//     board.async_send(r4::Command::osmc(358, r4::Direction::forward, 1), 500ms,
//                      [](const r4::CommandResult& result) { … });
//     io.run();
//
// Everything happens on the io_context's thread: call it there, the callbacks come there.
// Completion tokens work: callbacks, asio::use_future, asio::use_awaitable. The steady state
// allocates nothing.
#pragma once

#include <asio/async_result.hpp>
#include <asio/io_context.hpp>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "board_options.hpp"

namespace r4 {

class Registry;

class AsyncBoard {
 public:
  using Duration = std::chrono::milliseconds;

  // Throws Error{usage} for a wrong URL. `io` must outlive the board.
  AsyncBoard(asio::io_context& io, std::string_view url, BoardOptions options = {});
  ~AsyncBoard();
  AsyncBoard(const AsyncBoard&) = delete;
  AsyncBoard& operator=(const AsyncBoard&) = delete;

  // Opens the transport and begins the link. Throws Error.
  void open();
  // Cancels what is under way (outcome cancelled) and closes.
  void close();

  // void(const CommandResult&). Throws Error{usage} for a command outside its ranges.
  template <class Token>
  auto async_send(const Command& command, Duration timeout, Token&& token) {
    return asio::async_initiate<Token, void(CommandResult)>(
        [this](auto handler, const Command& c, Duration t) {
          start_send(c, t, make_completion(std::move(handler)));
        },
        token, command, timeout);
  }
  template <class Token>
  auto async_stop(Duration timeout, Token&& token) {
    return asio::async_initiate<Token, void(CommandResult)>(
        [this](auto handler, Duration t) { start_stop(t, make_completion(std::move(handler))); },
        token, timeout);
  }
  // Confirmed by the board's answer; identity() has it.
  template <class Token>
  auto async_identify(Duration timeout, Token&& token) {
    return asio::async_initiate<Token, void(CommandResult)>(
        [this](auto handler, Duration t) {
          start_identify(t, make_completion(std::move(handler)));
        },
        token, timeout);
  }

  bool post(const Command& command);

  const State& state() const;
  const LinkStatus& link() const;
  const BoardIdentity& identity() const;
  Statistics statistics() const;
  const CarrierCounters& carrier_counters() const;
  const std::string& name() const;

  // Callbacks are stored once; an empty function turns one off.
  void on_state(std::function<void(const State&, const Datagram&)> callback);
  void on_board_heartbeat(std::function<void(const Datagram&)> callback);
  void on_nack(std::function<void(const Nack&, const Datagram&)> callback);
  void on_bad_datagram(std::function<void(const ReadResult&, std::string_view)> callback);
  void on_link(std::function<void(const LinkStatus&)> callback);
  void on_event(std::function<void(const CarrierEvent&)> callback);

  void watchdog(Duration period);
  void feed();

 private:
  // A completion handler of any type, kept until its command ends. Allocated with the handler's
  // allocator, as Asio does for its own.
  class Completion {
   public:
    virtual ~Completion() = default;
    virtual void complete(const CommandResult& result) = 0;
  };
  template <class Handler>
  std::unique_ptr<Completion> make_completion(Handler handler);

  void start_send(const Command& command, Duration timeout, std::unique_ptr<Completion> completion);
  void start_stop(Duration timeout, std::unique_ptr<Completion> completion);
  void start_identify(Duration timeout, std::unique_ptr<Completion> completion);

  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// The transports of the library: those of transports/ and `sim:`, the simulated board in this
// process.
const Registry& standard_registry();

template <class Handler>
std::unique_ptr<AsyncBoard::Completion> AsyncBoard::make_completion(Handler handler) {
  class Typed final : public Completion {
   public:
    explicit Typed(Handler h) : handler_(std::move(h)) {}
    void complete(const CommandResult& result) override { std::move(handler_)(result); }

   private:
    Handler handler_;
  };
  return std::make_unique<Typed>(std::move(handler));
}

}  // namespace r4
