// SPDX-License-Identifier: GPL-3.0-or-later
#include "board_impl.hpp"

#include <asio/post.hpp>
#include <utility>

#include "../transports/file_descriptor.hpp"
#include "commands/command_help.hpp"
#include "commands/limits.hpp"
#include "r4link/commands/command_text.hpp"

namespace r4 {

Board::Impl::Impl(const CarriersMaker& make, BoardOptions options, BoardCallbacks first)
    : BlockingLoop({"board", "let the functions of your own transport return at once"}, 1,
                   std::move(options.on_wait)),
      arming(options.session.arming),
      callback_limit(options.callback_limit),
      async(io, make(loop), options),
      box(io, [this](const CommandOrGroup& what, bool late) { deliver(what, late); }),
      callbacks([this](Clock::duration busy) { on_callback_end(busy); },
                [this](int channel) {
                  const std::lock_guard lock(mutex);
                  return std::exchange(uarts[channel - 1].to_report, {});
                }) {
  require_callback_limit(callback_limit);
  callbacks.add<ReceivedState>(std::move(first.on_state));
  callbacks.add<LinkStatus>(std::move(first.on_link));
  callbacks.add<CarrierEvent>(std::move(first.on_event));
  callbacks.add<PathStatus>(std::move(first.on_path));
  callbacks.add_restart(std::move(first.on_restart));
  callbacks.add<DisarmCause>(std::move(first.on_arming));
  callbacks.add<RefusedPost>(std::move(first.on_refused));
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
    impl->callbacks.start(impl);
    try {
      impl->start([impl] { impl->io.run(); });
    } catch (...) {
      impl->callbacks.stop();
      throw;
    }
    return impl;
  });
}

// Ends the loop first. The loop does not wait for callbacks, so a callback may close the board.
void Board::Impl::close() {
  BlockingLoop::close({&async});
  keep(nullptr);  // after the loop, so that the farewell is recorded
  callbacks.stop();
}

void Board::Impl::keep(std::unique_ptr<Recording> own) {
  const std::lock_guard lock(mutex);
  recording.swap(own);
}

void Board::Impl::listen() {
  async.on_state([this](const ReceivedState& fresh, const Datagram&) {
    {
      const std::lock_guard lock(mutex);
      state = fresh;
      ++states;
      for_each_queue([&](States::Queue& queue) { queue.put(fresh); });
    }
    news.notify_all();
    callbacks.notify(fresh);
    take_uarts(fresh);
  });
  async.on_link([this](const LinkStatus& fresh) {
    {
      const std::lock_guard lock(mutex);
      link = fresh;
      state = async.state();  // heartbeats change `safe`
    }
    news.notify_all();
    callbacks.notify(fresh);
  });
  async.on_event([this](const CarrierEvent& event) {
    take_name();  // a reconnected board may have another port
    callbacks.notify(event);
  });
  async.on_path([this](const PathStatus& path) { callbacks.notify(path); });
  async.on_arming([this](DisarmCause fresh) {
    {
      const std::lock_guard lock(mutex);
      disarmed_by = fresh;
    }
    callbacks.notify(fresh);
  });
  async.on_refused([this](const RefusedPost& refused) { callbacks.notify(refused); });
  async.on_restart([this] {
    {
      const std::lock_guard lock(mutex);
      state = async.state();
      for (UartInbox& uart : uarts) uart.stream.restart();
    }
    callbacks.notify(CallbackThread::Restart{});
  });
}

void Board::Impl::take_name() {
  const std::lock_guard lock(mutex);
  name = async.name();
  last_paths = async.paths();
}

// The timer expires when a callback may reach the limit.
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
    if (next && *next >= callback_limit) return;  // also hangs: its end releases the heartbeats
    if (!std::exchange(held_for_callback, false)) return;
    async.hold_heartbeats(false);
    callbacks.notify(CarrierEvent{
        CarrierEvent::Kind::warning,
        Problem{ErrorKind::refused, "a callback",
                "the callback ran for " + std::to_string(ms) +
                    " ms, and the heartbeats stopped after " +
                    std::to_string(callback_limit.count()) + " ms",
                "do the work in another thread, or set BoardOptions::callback_limit"}});
  });
}

void Board::Impl::deliver(const CommandOrGroup& what, bool late) {
  PostResult result = late ? PostResult::late : PostResult::no_link;
  try {
    if (!late) result = std::visit([this](const auto& each) { return async.post(each); }, what);
  } catch (const Error&) {  // the program may have released control after the post
  }
  if (result) return;
  RefusedPost refused{first_of(what), Refusal::none, result};
  refused.command.text = refused.command.text2 = Text();
  const auto* const group = std::get_if<Setpoints>(&what);
  if (group != nullptr) refused.group = static_cast<std::uint8_t>(group->size());
  callbacks.notify(refused);
}

void Board::Impl::on_close() {
  for_each_queue([](States::Queue& queue) { queue.end(); });
  last_statistics = async.statistics();
  last_counters = async.carrier_counters();
  last_paths = async.paths();
  look_timer.cancel();
}

void Board::Impl::require_sendable(const CommandOrGroup& what) {
  if (const auto* const group = std::get_if<Setpoints>(&what)) {
    require_any(*group);
    return require_control(async.role(), *group);
  }
  const Command command = first_of(what);
  require_valid(command);
  require_control(async.role(), command);
  const std::lock_guard lock(mutex);
  for (const PathStatus& path : last_paths) require_cable(path.name, command);
}

void Board::Impl::execute(const CommandOrGroup& what, Duration timeout) {
  require_sendable(what);
  const bool stop = first_of(what).kind == CommandKind::stop;
  const auto run_it = [&](const auto& each) {
    const std::string text = shown(each);
    require_timeout(text, timeout);
    confirmed(each, run(text, start_of(what), timeout, stop));
  };
  std::visit(run_it, what);
}

std::shared_ptr<const Board::Impl::Part> Board::Impl::run(const std::string& text, Start start,
                                                          Duration timeout, bool stop) {
  const auto call = std::make_shared<Call>(text, std::move(start), std::vector{&async}, stop);
  BlockingLoop::run(call, timeout);
  const Part& part = call->parts.front();
  if (part.trouble) throw Error(*part.trouble);
  if (part.result.outcome == Outcome::closed) throw closed_error(text);
  return {call, &part};
}

PostResult Board::Impl::post(const CommandOrGroup& what) {
  require_sendable(what);
  const CommandKind kind = first_of(what).kind;
  const std::lock_guard lock(mutex);
  if (closed || (!link.in_control && kind != CommandKind::stop)) return PostResult::no_link;
  const bool disarmed = arming == Arming::required && disarmed_by != DisarmCause::none;
  if (disarmed && drives_output(kind)) {
    ++refused_here;
    return PostResult::not_armed;
  }
  return box.put(what) ? PostResult::sent : PostResult::queue_full;
}

}  // namespace r4
