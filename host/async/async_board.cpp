// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/async_board.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include "../../transports/file_descriptor.hpp"
#include "../board_loop.hpp"
#include "../commands/command_help.hpp"
#include "../commands/limits.hpp"
#include "../commands/link_timing.hpp"
#include "../standard_registry.hpp"
#include "async_board_impl.hpp"
#include "r4link/commands/command_text.hpp"

namespace r4 {

namespace {

std::vector<std::unique_ptr<Carrier>> only(std::unique_ptr<Carrier> carrier) {
  std::vector<std::unique_ptr<Carrier>> carriers;
  carriers.push_back(std::move(carrier));
  return carriers;
}

constexpr AsyncBoard::Duration posted_stop_time{1000};

}  // namespace

AsyncBoard::AsyncBoard(const executor_type& executor, std::string_view url, BoardOptions options)
    : AsyncBoard(executor, std::vector<std::string>{std::string(url)}, std::move(options)) {}

AsyncBoard::AsyncBoard(const executor_type& executor, const std::vector<std::string>& urls,
                       BoardOptions options)
    : AsyncBoard(executor, make_host_carriers(executor.context(), urls, options.role), options) {}

AsyncBoard::AsyncBoard(const executor_type& executor, std::unique_ptr<Carrier> carrier,
                       BoardOptions options)
    : AsyncBoard(executor, only(std::move(carrier)), std::move(options)) {}

AsyncBoard::AsyncBoard(const executor_type& executor,
                       std::vector<std::unique_ptr<Carrier>> carriers, BoardOptions options)
    : impl_(with_system_errors("a board", [&] {
        require_paths(carriers.size());
        return std::make_shared<Impl>(executor.context(), std::move(carriers), std::move(options));
      })) {}

AsyncBoard::~AsyncBoard() {
  impl_->close();
  // In a callback, the transport runs: it is destroyed after the callback.
  if (impl_->depth > 0) asio::post(impl_->io, [keep = impl_] {});
}

void AsyncBoard::open() { impl_->open(); }
void AsyncBoard::close() { impl_->close(); }

AsyncBoard::executor_type AsyncBoard::get_executor() const noexcept {
  return impl_->io.get_executor();
}

// The cancellation is posted, because a slot must not lose its handler while the handler runs.
void AsyncBoard::Cancel::operator()(asio::cancellation_type) const {
  const std::shared_ptr<Impl> impl = impl_.lock();
  if (impl) asio::post(impl->io, [impl, command = command_] { impl->cancel(command); });
}

void AsyncBoard::require_timeout(std::string_view what, Duration timeout) {
  r4::require_timeout(what, timeout);
}
void AsyncBoard::require_control(std::string_view what) const {
  r4::require_control(impl_->session.board_role(), what);
}
void AsyncBoard::require_wait(std::string_view what, Duration timeout) {
  r4::require_wait(what, timeout);
}

template <class What>
void AsyncBoard::start_send(const What& what, Duration timeout, CompletionPtr completion) {
  Impl& impl = *impl_;
  impl.give_up_slot(what);
  impl.begin(std::move(completion),
             [&] { return impl.session.send(what, bounded(timeout), impl.now); });
}
template void AsyncBoard::start_send(const Command&, Duration, CompletionPtr);
template void AsyncBoard::start_send(const Setpoints&, Duration, CompletionPtr);

void AsyncBoard::start_arm(Duration timeout, CompletionPtr completion) {
  Impl& impl = *impl_;
  impl.begin(std::move(completion), [&] { return impl.session.arm(bounded(timeout), impl.now); });
}

void AsyncBoard::start_wait_active(Duration timeout, CompletionPtr completion) {
  Impl& impl = *impl_;
  impl.enter(Completion::How::post, [&] {
    const Ticket id = impl.waits.next_id();
    completion->listen(Cancel(impl_, id));
    impl.waits.add({Impl::Waits::For::active, id, 0, impl.now, impl.now + bounded(timeout),
                    std::move(completion)});
  });
}

void AsyncBoard::start_transfer(const Command& command, Duration timeout,
                                CompletionPtr completion) {
  if (command.kind != CommandKind::i2c_read && command.kind != CommandKind::i2c_write &&
      command.kind != CommandKind::i2c_scan) {
    throw Error(ErrorKind::usage, shown(command), "is not a valid transfer on the I2C bus",
                "send it with send() or async_send()");
  }
  const Time deadline = Impl::steady_now() + bounded(timeout);
  // `pnum`: of the command, when the board has confirmed it.
  const auto next = [deadline, pnum = std::optional<std::uint32_t>()](
                        Impl::Sequence& steps, CommandResult result, Completion::How how) mutable {
    if (!pnum) {
      if (result.outcome != Outcome::confirmed) return steps.end(result, how);
      pnum = result.pnum;
      return steps.wait(Impl::Waits::For::answer, *pnum, deadline);
    }
    result.pnum = *pnum;
    result.executed = 1;
    if (result.outcome == Outcome::confirmed) {
      result.transfer = steps.impl().session.state().i2c_answer;
      if (result.transfer.outcome != I2cOutcome::done) result.outcome = Outcome::refused;
    }
    steps.end(result, how);
  };
  (new Impl::Steps(*impl_, std::move(completion), next))->send(command, bounded(timeout));
}

void AsyncBoard::start_close(Duration timeout, CompletionPtr completion) {
  const auto next = [](Impl::Sequence& steps, const CommandResult& result, Completion::How how) {
    steps.impl().close();
    steps.end(result, how);
  };
  Impl& impl = *impl_;
  impl.begin(CompletionPtr(new Impl::Steps(impl, std::move(completion), next)),
             [&] { return impl.leave(bounded(timeout)); });
}

BoardRole AsyncBoard::role() const { return impl_->role; }

// The role must not change while control is being released, because the board may not be safe.
void AsyncBoard::require_role_settled(std::string_view what) const {
  if (!impl_->is_open() || !impl_->session.leaving()) return;
  throw Error(ErrorKind::usage, std::string(what), "control is being released",
              "wait until the release has ended");
}

void AsyncBoard::take_control() {
  if (!impl_->is_open()) {
    throw Error(ErrorKind::usage, "take_control()", "the board is not open",
                "call this function between open() and close()");
  }
  require_role_settled("take_control()");
  if (role() != BoardRole::control) impl_->become(BoardRole::control);
}

void AsyncBoard::start_release_control(Duration timeout, CompletionPtr completion) {
  Impl& impl = *impl_;
  if (impl.is_open() && role() == BoardRole::watch) {
    completion.release()->complete({Outcome::confirmed}, Completion::How::post);
    return;
  }
  const auto next = [](Impl::Sequence& steps, const CommandResult& result, Completion::How how) {
    if (steps.impl().is_open()) steps.impl().become(BoardRole::watch);
    steps.end(result, how);
  };
  impl.begin(
      CompletionPtr(new Impl::Steps(impl, std::move(completion), next)),
      [&] {
        impl.cancel_waits();
        return impl.session.leave(bounded(timeout), impl.now, Outcome::cancelled);
      },
      0, Outcome::none);
}

void AsyncBoard::require_link_timing(Duration board_timeout, Duration heartbeat) const {
  r4::require_link_timing(board_timeout, heartbeat, Duration{impl_->heartbeat_ms});
}

void AsyncBoard::start_link_timing(Duration board_timeout, Duration heartbeat, Duration timeout,
                                   CompletionPtr completion) {
  const Time deadline = Impl::steady_now() + bounded(timeout);
  const auto next = [all = link_timing_steps(board_timeout, heartbeat), begun = std::size_t{0},
                     deadline](Impl::Sequence& steps, const CommandResult& result,
                               Completion::How how) mutable {
    if (result.outcome != Outcome::confirmed || begun == all.size()) return steps.end(result, how);
    const LinkTimingStep& step = all[begun++];
    const std::string value = std::to_string(step.ms);
    steps.send(Command::setting(step.key, Text(value)),
               std::max(Time{0}, deadline - Impl::steady_now()));
  };
  // The first step begins as if a step before it were confirmed.
  (new Impl::Steps(*impl_, std::move(completion), next))
      ->complete({Outcome::confirmed}, Completion::How::post);
}

void AsyncBoard::require_sendable(const Command& command) const {
  require_valid(command);
  r4::require_control(impl_->session.board_role(), command);
  for (const auto& path : impl_->paths) require_cable(path->carrier->name(), command);
}
void AsyncBoard::require_sendable(const Setpoints& setpoints) const {
  require_any(setpoints);
  r4::require_control(impl_->session.board_role(), setpoints);
}

PostResult AsyncBoard::post(const Command& command) {
  if (command.kind == CommandKind::stop) {
    if (!impl_->is_open()) return PostResult::no_link;
    async_send(command, posted_stop_time, [](const CommandResult&) {});
    return PostResult::sent;
  }
  require_sendable(command);
  impl_->give_up_slot(command);
  return impl_->post(command);
}
PostResult AsyncBoard::post(const Setpoints& setpoints) {
  require_sendable(setpoints);
  return impl_->post(setpoints);
}

const ReceivedState& AsyncBoard::state() const { return impl_->session.state(); }
const LinkStatus& AsyncBoard::link() const { return impl_->session.link(); }
bool AsyncBoard::in_control() const {
  return impl_->is_open() && impl_->session.in_control(Impl::steady_now());
}
DisarmCause AsyncBoard::disarmed_by() const { return impl_->session.disarmed_by(); }
const BoardIdentity& AsyncBoard::identity() const { return impl_->identity; }
Statistics AsyncBoard::statistics() const { return impl_->session.statistics(Impl::steady_now()); }
const CarrierCounters& AsyncBoard::carrier_counters() const { return impl_->paths.counters(); }
const std::string& AsyncBoard::name() const { return impl_->paths.name(); }
std::vector<PathStatus> AsyncBoard::paths() const { return impl_->statuses(); }

PathStatus AsyncBoard::Impl::status_of(std::size_t path) const {
  PathStatus made = session.path(path, steady_now());
  made.name = carrier(path).name();
  return made;
}
std::vector<PathStatus> AsyncBoard::Impl::statuses() const {
  std::vector<PathStatus> all;
  for (std::size_t i = 0; i < paths.size(); ++i) all.push_back(status_of(i));
  return all;
}

void AsyncBoard::describe(const Device& device) { impl_->describe(device); }

void AsyncBoard::Impl::describe(const Device& device) {
  const auto is_same = [&](const Device& each) {
    return each.place() == device.place() && each.description().text == device.description().text;
  };
  if (std::any_of(devices.begin(), devices.end(), is_same)) return;
  std::erase_if(devices, [&](const Device& each) { return device.takes_place_of(each); });
  devices.push_back(device);
  for (const auto& path : paths) path->tap.on_device(device);
}

void AsyncBoard::record(Recording& recording) {
  Impl& impl = *impl_;
  for (const auto& path : impl.paths) {
    const Carrier& transport = *path->carrier;
    path->tap.attach(recording.recorder_, transport.name());
    if (!transport.up()) continue;
    path->tap.on_carrier_event({CarrierEvent::Kind::up, {{}, transport.name(), {}, {}}});
  }
  impl.paths[0].tap.on_link(impl.session.link());
  impl.name_in_recording();
  for (const Device& device : impl.devices) {
    for (const auto& path : impl.paths) path->tap.on_device(device);
  }
}

void AsyncBoard::Impl::name_in_recording() {
  const std::string& board = identity.name.empty() ? identity.board_id : identity.name;
  if (board.empty()) return;
  for (const auto& path : paths) path->tap.on_name(board);
}

void AsyncBoard::Impl::warn_of_recordings() {
  std::optional<Problem> problem;
  for (const auto& path : paths) {
    std::optional<Problem> news = path->tap.take_news();
    if (news && !problem) problem = std::move(news);
  }
  if (problem) warn(std::move(*problem));
}

Subscription AsyncBoard::on_state(
    std::function<void(const ReceivedState&, const Datagram&)> callback) {
  return impl_->callbacks.state.add(std::move(callback));
}
Subscription AsyncBoard::on_board_heartbeat(std::function<void(const Datagram&)> callback) {
  return impl_->callbacks.heartbeat.add(std::move(callback));
}
Subscription AsyncBoard::on_nack(std::function<void(const Nack&, const Datagram&)> callback) {
  return impl_->callbacks.nack.add(std::move(callback));
}
Subscription AsyncBoard::on_bad_datagram(
    std::function<void(const ReadResult&, std::string_view)> callback) {
  return impl_->callbacks.bad.add(std::move(callback));
}
Subscription AsyncBoard::on_overheard(std::function<void(std::string_view)> callback) {
  return impl_->callbacks.overheard.add(std::move(callback));
}
Subscription AsyncBoard::on_link(std::function<void(const LinkStatus&)> callback) {
  return impl_->callbacks.link.add(std::move(callback));
}
Subscription AsyncBoard::on_path(std::function<void(const PathStatus&)> callback) {
  return impl_->callbacks.path.add(std::move(callback));
}
Subscription AsyncBoard::on_event(std::function<void(const CarrierEvent&)> callback) {
  return impl_->callbacks.event.add(std::move(callback));
}
Subscription AsyncBoard::on_restart(std::function<void()> callback) {
  return impl_->callbacks.restart.add(std::move(callback));
}
Subscription AsyncBoard::on_arming(std::function<void(DisarmCause)> callback) {
  return impl_->callbacks.arming.add(std::move(callback));
}
Subscription AsyncBoard::on_refused(std::function<void(const RefusedPost&)> callback) {
  return impl_->callbacks.refused.add(std::move(callback));
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

asio::io_context& context_of(Loop& loop) { return static_cast<BoardLoop&>(loop).io; }

void AsyncBoard::feed() { impl_->fed.store(Impl::steady_now().count(), std::memory_order_relaxed); }

}  // namespace r4
