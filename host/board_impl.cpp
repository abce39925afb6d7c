// SPDX-License-Identifier: GPL-3.0-or-later
#include "board_impl.hpp"

#include <algorithm>
#include <asio/post.hpp>
#include <utility>

#include "../transports/file_descriptor.hpp"
#include "commands/command_help.hpp"
#include "session/limits.hpp"

namespace r4 {

namespace {

// The session ends every command at its deadline, which is that of the call. A call that has been
// begun and waits longer than this beyond it is held up by a transport that does not return.
constexpr std::chrono::milliseconds grace{500};

// So long does close() wait for the board to say that it is free.
constexpr std::chrono::milliseconds farewell_limit{100};

// `instead`: what that means for what was asked.
Error blocked_error(std::string_view what, std::string_view instead) {
  return Error(Problem{ErrorKind::refused, std::string(what),
                       std::string(instead) + ": the board's thread does not answer",
                       "a transport of your own must return at once", Outcome::blocked});
}

}  // namespace

Board::Impl::Call::Call(const Command& c)
    : command(c), text(c.text.data(), c.text.size()), text2(c.text2.data(), c.text2.size()) {
  command.text = text;
  command.text2 = text2;
}

Board::Impl::Impl(const CarriersMaker& make, BoardOptions options, BoardCallbacks first)
    : role(options.role),
      arming(options.session.arming),
      callback_limit(options.callback_limit),
      on_wait(std::move(options.on_wait)),
      async(io, make(loop), options),
      box(
          io, [this](const Command& c) { deliver(c); }, [this](const Setpoints& s) { deliver(s); }),
      callbacks([this](Clock::duration busy) { on_callback_end(busy); }) {
  require_callback_limit(callback_limit);
  if (first.on_state) callbacks.on_state(std::move(first.on_state));
  if (first.on_link) callbacks.on_link(std::move(first.on_link));
  if (first.on_event) callbacks.on_event(std::move(first.on_event));
  if (first.on_wire) callbacks.on_wire(std::move(first.on_wire));
  if (first.on_restart) callbacks.on_restart(std::move(first.on_restart));
  if (first.on_arming) callbacks.on_arming(std::move(first.on_arming));
  if (first.on_refused) callbacks.on_refused(std::move(first.on_refused));
  callbacks.take_uart([this](int channel) {
    const std::lock_guard lock(mutex);
    return std::exchange(uarts[channel - 1].to_tell, {});
  });
  listen();
  async.open();
  take_name();
  if (callback_limit != Duration{0}) look_at_callbacks();
}

std::shared_ptr<Board::Impl> Board::Impl::started(const CarriersMaker& make, BoardOptions options,
                                                  BoardCallbacks first) {
  return with_system_errors("a board", [&] {
    require_watches();
    auto impl = std::make_shared<Impl>(make, std::move(options), std::move(first));
    impl->start();
    return impl;
  });
}

void Board::Impl::start() {
  callbacks.start(shared_from_this());
  try {
    thread = std::thread([self = shared_from_this()] { self->io.run(); });
  } catch (...) {
    callbacks.stop();
    throw;
  }
}

// The loop first: it waits for no callback, so that a callback may close the board.
void Board::Impl::close() {
  {
    const std::lock_guard lock(mutex);
    if (!closed) asio::post(io, [this] { shut(); });
  }
  {
    const std::lock_guard lock(joining);
    if (thread.joinable()) thread.join();
    recording.reset();  // with the farewell in it
  }
  callbacks.stop();
}

void Board::Impl::keep(std::unique_ptr<Recording> own) {
  const std::lock_guard lock(joining);
  recording.swap(own);
}

// --- on the loop

void Board::Impl::listen() {
  async.on_state([this](const ReceivedState& fresh, const Datagram&) {
    {
      const std::lock_guard lock(mutex);
      state = fresh;
      ++states;
      in_control = async.in_control();
      for_each_queue([&](States::Queue& queue) { queue.put(fresh); });
    }
    news.notify_all();
    tell(fresh);
    take_uarts(fresh);
  });
  async.on_link([this](const LinkStatus& fresh) {
    {
      const std::lock_guard lock(mutex);
      link = fresh;
      state = async.state();  // heartbeats change its `safe`
      in_control = async.in_control();
    }
    news.notify_all();
    tell(fresh);
  });
  async.on_event([this](const CarrierEvent& event) {
    take_name();  // a board that was plugged in again may be at another port
    tell(event);
  });
  async.on_wire([this](const Wire& wire) { tell(wire); });
  async.on_arming([this](DisarmCause fresh) {
    {
      const std::lock_guard lock(mutex);
      disarmed_by = fresh;
    }
    tell(fresh);
  });
  async.on_refused([this](const RefusedPost& refused) { tell(refused); });
  async.on_restart([this] {
    {
      const std::lock_guard lock(mutex);
      state = async.state();
      for (UartInbox& uart : uarts) uart.stream.restart();
    }
    tell(CallbackThread::Restart{});
  });
}

void Board::Impl::take_name() {
  const std::vector<Wire> wires = async.wires();
  const std::lock_guard lock(mutex);
  name = async.name();
  wire_names.clear();
  for (const Wire& wire : wires) wire_names.push_back(wire.name);
}

void Board::Impl::tell(CallbackThread::Notice notice) { callbacks.tell(std::move(notice)); }

// Heartbeats say that somebody looks after the robot. Looks again when the callback that runs now, or one
// that begins at once, reaches the limit.
void Board::Impl::look_at_callbacks() {
  const auto busy = callbacks.busy_for();
  const bool hangs = busy && *busy >= callback_limit;
  if (hangs && !held_for_callback) async.hold_heartbeats(held_for_callback = true);
  look_timer.expires_after(busy && !hangs ? callback_limit - *busy : callback_limit);
  look_timer.async_wait([this](const std::error_code& error) {
    if (!error) look_at_callbacks();
  });
}

// On the callbacks' thread.
void Board::Impl::on_callback_end(Clock::duration busy) {
  if (callback_limit == Duration{0} || busy < callback_limit) return;
  const std::lock_guard lock(mutex);
  if (closed) return;
  const auto ms = std::chrono::duration_cast<Duration>(busy).count();
  asio::post(io, [this, ms] {
    const auto next = callbacks.busy_for();
    if (next && *next >= callback_limit) return;  // it hangs, too: its own end releases them
    if (!std::exchange(held_for_callback, false)) return;
    async.hold_heartbeats(false);
    tell(CarrierEvent{
        CarrierEvent::Kind::warning,
        Problem{ErrorKind::refused, "a callback",
                "it ran for " + std::to_string(ms) + " ms, and after " +
                    std::to_string(callback_limit.count()) + " ms the heartbeats stopped",
                "do the work in another thread, or set BoardOptions::callback_limit"}});
  });
}

void Board::Impl::deliver(const Command& command) {
  if (command.kind == CommandKind::stop) {
    async.async_stop(default_timeout, [](const CommandResult&) {});
  } else if (const PostResult result = async.post(command); !result) {
    RefusedPost refused{command, Refusal::none, result};
    refused.command.text = refused.command.text2 = Text();
    tell(refused);
  }
}

void Board::Impl::deliver(const Setpoints& setpoints) {
  if (const PostResult result = async.post(setpoints); !result) {
    RefusedPost refused{setpoints[0], Refusal::none, result};
    refused.group = static_cast<std::uint8_t>(setpoints.size());
    tell(refused);
  }
}

// A stop is sent however late it is; anything else only while its caller waits for it.
void Board::Impl::begin(const CallPtr& call, Clock::time_point deadline) {
  const bool stop = call->command.kind == CommandKind::stop;
  auto left = std::chrono::ceil<Duration>(deadline - Clock::now());
  {
    const std::lock_guard lock(mutex);
    if (!stop && (call->abandoned || left <= Duration{0})) return;
    call->begun = true;
  }
  Call::End end(call->cancelled.slot(),
                [this, call](const CommandResult& result) { finish(*call, result); });
  if (call->start) {
    call->start(left, std::move(end));
  } else if (stop) {
    async.async_stop(left > Duration{0} ? left : default_timeout, std::move(end));
  } else if (call->command.kind == CommandKind::identify) {
    async.async_identify(left, std::move(end));
  } else {
    async.async_send(call->command, left, std::move(end));
  }
}

void Board::Impl::finish(Call& call, const CommandResult& result) {
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
void Board::Impl::shut() {
  {
    const std::lock_guard lock(mutex);
    if (closed) return;
    closed = true;
    for_each_queue([](States::Queue& queue) { queue.end(); });
    last_statistics = async.statistics();
    last_counters = async.carrier_counters();
    last_wires = async.wires();
  }
  news.notify_all();
  look_timer.cancel();
  async.async_close(farewell_limit, [this](const CommandResult&) {
    work.reset();
    // Twice around: the ends of commands that begin() finds closed come behind this one.
    asio::post(io, [this] { asio::post(io, [this] { io.stop(); }); });
  });
}

// --- on any thread

// A day is as good as for ever, and cannot overflow.
Board::Duration Board::Impl::bounded(Duration timeout) {
  return std::clamp<Duration>(timeout, Duration{0}, std::chrono::hours{24});
}

Error Board::Impl::closed_error(std::string_view what) {
  return Error(Problem{ErrorKind::refused, std::string(what), "the board was closed",
                       "open it again with another Board", Outcome::closed});
}

void Board::Impl::require_sendable(const Command& command) {
  require_valid(command);
  require_control(role, command);
  if (command.kind != CommandKind::setting) return;
  const std::lock_guard lock(mutex);
  for (const std::string& wire : wire_names) require_cable(wire, command);
}

Board::Impl::CallPtr Board::Impl::execute(const Command& command, Duration timeout) {
  return execute(shown(command), std::make_shared<Call>(command), timeout);
}

Board::Impl::CallPtr Board::Impl::execute(const std::string& text, CallPtr call, Duration timeout) {
  run(text, call, bounded(timeout));
  if (call->result.outcome == Outcome::confirmed) return call;
  throw Error(explain(text, call->result, call->link));
}

void Board::Impl::run(const std::string& text, const CallPtr& call, Duration timeout) {
  const auto deadline = call->called + timeout;
  std::unique_lock lock(mutex);
  if (closed) throw closed_error(text);
  asio::post(io, [this, call, deadline] { begin(call, deadline); });
  const auto is_done = [&] { return call->done; };
  bool done = false;
  try {
    done = wait_until(lock, call->ended, deadline, is_done) ||
           (call->begun && wait_until(lock, call->ended, deadline + grace, is_done));
  } catch (...) {
    abandon(call);
    throw;
  }
  if (!done) {
    call->abandoned = true;
    if (call->command.kind == CommandKind::stop) {
      throw Error(Problem{ErrorKind::refused, text,
                          "not confirmed: the board's thread does not answer, and sends it when it "
                          "does",
                          std::string(stop_last_resort), Outcome::blocked});
    }
    throw blocked_error(
        text, call->begun ? "not confirmed, it may have been executed or not" : "not sent");
  }
  if (call->result.outcome == Outcome::closed) throw closed_error(text);
}

void Board::Impl::abandon(const CallPtr& call) {
  const std::lock_guard lock(mutex);
  call->abandoned = true;
  if (closed) return;
  asio::post(io, [call] { call->cancelled.emit(asio::cancellation_type::terminal); });
}

void Board::Impl::run_on_loop(std::string_view what, std::function<void()> action) {
  const auto call = std::make_shared<Call>(Command());
  std::unique_lock lock(mutex);
  if (closed) return;
  asio::post(io, [this, call, action = std::move(action)] {
    {
      const std::lock_guard begin_lock(mutex);
      if (call->abandoned) return;
      call->begun = true;
    }
    action();
    finish(*call, {});
  });
  const auto is_done = [&] { return call->done; };
  if (call->ended.wait_for(lock, default_timeout, is_done)) return;
  if (!call->begun) {
    call->abandoned = true;
    throw blocked_error(what, "not done");
  }
  call->ended.wait(lock, is_done);
}

PostResult Board::Impl::post(const Command& command) {
  require_sendable(command);
  const std::lock_guard lock(mutex);
  const bool stop = command.kind == CommandKind::stop;
  if (closed || (!in_control && !stop)) return PostResult::no_link;
  if (drives_output(command.kind) && is_held_back()) return PostResult::not_armed;
  return box.put(command) ? PostResult::sent : PostResult::queue_full;
}
PostResult Board::Impl::post(const Setpoints& setpoints) {
  require_any(setpoints);
  require_control(role, setpoints);
  const std::lock_guard lock(mutex);
  if (closed || !in_control) return PostResult::no_link;
  if (is_held_back()) return PostResult::not_armed;
  return box.put(setpoints) ? PostResult::sent : PostResult::queue_full;
}
// Are output commands refused here? Under the lock.
bool Board::Impl::is_held_back() {
  if (arming != Arming::required || disarmed_by == DisarmCause::none) return false;
  ++refused_here;
  return true;
}

std::string Board::Impl::name_now() {
  const std::lock_guard lock(mutex);
  return name;
}
LinkStatus Board::Impl::link_now() {
  const std::lock_guard lock(mutex);
  return link;
}
std::uint64_t Board::Impl::states_now() {
  const std::lock_guard lock(mutex);
  return states;
}

}  // namespace r4
