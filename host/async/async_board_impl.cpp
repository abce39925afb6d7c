// SPDX-License-Identifier: GPL-3.0-or-later
#include "async_board_impl.hpp"

#include <algorithm>
#include <array>
#include <string>

#include "../../transports/file_descriptor.hpp"
#include "r4link/messages/message.hpp"

namespace r4 {

namespace {

// The session uses the steady clock. `clock_start` is the system time at the zero of this clock.
SessionOptions with_clock(SessionOptions options, Time now) {
  const auto epoch = std::chrono::system_clock::now().time_since_epoch();
  options.clock_start = std::chrono::duration_cast<Time>(epoch) - now;
  return options;
}

// After this time outside the event loop, only the newest waiting state is reported.
constexpr Time held_up{std::chrono::milliseconds{50}};
// From this delay on a warning is reported, because two heartbeats were late.
constexpr Time very_late{std::chrono::milliseconds{200}};
constexpr std::chrono::seconds open_interval{1};

}  // namespace

AsyncBoard::Impl::Impl(asio::io_context& context, std::vector<std::unique_ptr<Carrier>> transports,
                       BoardOptions options)
    : io(context),
      paths(*this, std::move(transports)),
      heartbeat_ms(options.session.timing.heartbeat_ms),
      board_timeout(std::chrono::milliseconds(options.session.timing.timeout_ms)),
      session(with_clock(std::move(options.session), steady_now()), options.role, paths.size()),
      role(options.role),
      timer(context),
      reopening(context) {}

// Returns the delay of due actions; 0 inside another entry.
Time AsyncBoard::Impl::begin_entry(Completion::How way) {
  if (depth == 0) how = way;
  session.on_trouble(paths.trouble());
  const Time before = std::exchange(now, steady_now());
  if (now - before > held_up) backlog.on_held_up();
  return has_link() && depth == 0 ? now - due : Time{0};
}

void AsyncBoard::Impl::end_entry(Time late) {
  if (is_open() && late > very_late) {
    poll_wanted = true;
    const Inside warning(depth);
    const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(late).count();
    warn({ErrorKind::refused, "the event loop",
          "the loop did not run: datagrams, including heartbeats, were sent " + std::to_string(ms) +
              " ms late",
          "let the handlers on this loop return at once; if the handlers are fast, give this "
          "program more processor time"});
  }
  const Inside inside(depth);
  for (;;) {
    notify_all();
    // A dispatched handler may start commands. The ends of these commands are appended.
    while (std::optional<Waits::Ended> ended = waits.take_ended()) {
      guarded([&] { ended->completion.release()->complete(ended->result, how); });
    }
    if (poll_wanted && has_link()) {
      poll_wanted = false;
      session.poll(now);
      send_all();
      due = session.next_poll(now);
    } else if (!end_waits() && !session.effects().any_events()) {
      break;
    }
  }
  if (has_link()) arm();
}

// Datagrams from before the sleep are dropped: they may wait in sockets and buffers.
void AsyncBoard::Impl::on_sleep() {
  backlog.on_sleep();
  session.on_sleep(now);
  cancel_waits();
  poll_wanted = true;
}

bool AsyncBoard::Impl::end_waits() {
  // With a pnum of 0, the state has no answer.
  const std::uint32_t answered = session.state().i2c_answer.pnum;
  return waits.end_conditions(
      [&](const Waits::Condition& each) -> std::optional<Outcome> {
        if (!is_open()) return Outcome::closed;
        const bool for_link = each.what == Waits::For::active;
        const bool has_come = for_link ? is_ready(session.board_role(), session.link())
                                       : each.pnum != 0 && each.pnum == answered;
        if (has_come) return Outcome::confirmed;
        if (for_link && session.link().cannot_begin()) return Outcome::refused;
        if (now < each.deadline) return std::nullopt;
        return each.what == Waits::For::time ? Outcome::confirmed : Outcome::timed_out;
      },
      now);
}

void AsyncBoard::Impl::cancel(Ticket id) {
  enter(Completion::How::post, [&] {
    const Ticket ticket = waits.cancel(id, now);
    if (ticket == 0) return;
    session.cancel(ticket, now);
    notify_all();                             // reports the end with the known facts
    waits.end(ticket, {Outcome::cancelled});  // a stop continues; only the wait ends
    poll_wanted = true;
  });
}

void AsyncBoard::Impl::open() {
  if (phase != Phase::made) {
    throw Error(ErrorKind::usage, paths.name(), "a board can be opened only once",
                "make a new AsyncBoard for the same URL");
  }
  for (const auto& path : paths) {
    open_path(*path);
    if (phase != Phase::made) return;  // a callback for `up` has closed the board
  }
  if (std::all_of(paths.begin(), paths.end(),
                  [](const auto& each) { return each->trouble.has_value(); })) {
    throw Error(*paths[0].trouble);
  }
  for (const auto& path : paths) {
    if (path->trouble) report_trouble(*path);
    if (phase != Phase::made) return;
  }
  phase = Phase::open;
  sleep_watch = SleepWatch();
  due = steady_now();
  enter(Completion::How::post, [this] { poll_wanted = true; });
  open_again();
}

void AsyncBoard::Impl::open_path(Path& path) {
  try {
    with_system_errors(path.carrier->name(), [&] { path.carrier->open(path); });
    path.trouble.reset();
  } catch (const Error& error) {
    if (phase == Phase::made && error.kind() == ErrorKind::usage) {
      paths.close();
      throw;
    }
    const bool news = !path.trouble || path.trouble->text() != error.problem().text();
    path.trouble = error.problem();
    if (news && phase == Phase::open) report_trouble(path);
  }
}

void AsyncBoard::Impl::open_again() {
  if (std::none_of(paths.begin(), paths.end(),
                   [](const auto& each) { return each->trouble.has_value(); })) {
    return;
  }
  reopening.expires_after(open_interval);
  reopening.async_wait([self = shared_from_this()](const std::error_code& error) {
    if (error) return;
    for (const auto& path : self->paths) {
      if (path->trouble && self->has_link()) self->guarded([&] { self->open_path(*path); });
    }
    if (self->has_link()) self->open_again();
  });
}

Ticket AsyncBoard::Impl::leave(Time timeout) {
  phase = Phase::leaving;
  return session.leave(timeout, now);
}

void AsyncBoard::Impl::close() {
  if (phase == Phase::closed) return;
  if (is_open()) enter(Completion::How::post, [this] { leave(Time{0}); });
  phase = Phase::closed;
  paths.close();
  timer.cancel();
  reopening.cancel();
  how = Completion::How::post;
  enter(Completion::How::post, [this] { session.end_all(now); });
}

void AsyncBoard::Impl::cancel_waits() {
  waits.end_conditions([](const Waits::Condition&) { return std::optional(Outcome::cancelled); },
                       now);
}

// Takes control on all paths or none. Watching is never refused. Transports may reopen.
void AsyncBoard::Impl::become(BoardRole fresh) {
  std::size_t changed = 0;
  try {
    for (; changed < paths.size(); ++changed) carrier(changed).change_role(fresh);
  } catch (...) {
    if (fresh == BoardRole::control) {
      for (std::size_t i = 0; i < changed; ++i) carrier(i).change_role(session.board_role());
      throw;
    }
    guarded([] { throw; });
    while (++changed < paths.size()) guarded([&] { carrier(changed).change_role(fresh); });
  }
  enter(Completion::How::post, [&] {
    session.change_role(fresh, now);
    role = fresh;
    if (fresh == BoardRole::watch) cancel_waits();
    for (const auto& path : paths) {
      if (!path->carrier->up()) continue;
      session.on_transport(path->index, true, now, !only_listens(path->index));
    }
    poll_wanted = true;
  });
}

// Sets the timer only for an earlier time. An early expiry costs one poll.
void AsyncBoard::Impl::arm() {
  const Time next = waits.next(due);
  if (armed_for <= next) return;
  armed_for = next;
  timer.expires_at(std::chrono::steady_clock::time_point(next));
  timer.async_wait([self = shared_from_this()](const std::error_code& error) {
    if (!error) self->on_timer();
  });
}

void AsyncBoard::Impl::on_timer() {
  if (!has_link()) return;
  armed_for = Time::max();
  const bool notifies_backlog = backlog.on_timer();
  enter(Completion::How::dispatch, [this] {
    poll_wanted = true;
    warn_of_recordings();
  });
  if (notifies_backlog) notify_backlog();
}

void AsyncBoard::Impl::on_datagram(Path& path, std::string_view bytes) {
  enter(Completion::How::dispatch, [&] {
    path.tap.on_received(bytes, now);
    if (backlog.drops()) return;
    session.receive(path.index, bytes, now);
    paths[0].tap.on_packets(session.packets());
    poll_wanted = true;
    send_all();
    notify_all();  // events may contain views of these bytes
  });
}

void AsyncBoard::Impl::on_drained() {
  backlog.on_drained();
  notify_backlog();
}

void AsyncBoard::Impl::notify_backlog() {
  const Text state = backlog.take();
  if (state.empty()) return;
  enter(Completion::How::dispatch, [&] {
    Datagram datagram;
    if (is_open() && read_datagram(state, datagram)) {
      call(callbacks.state, session.state(), datagram);
    }
  });
}

void AsyncBoard::Impl::on_carrier_event(Path& path, const CarrierEvent& event) {
  enter(Completion::How::dispatch, [&] {
    path.tap.on_carrier_event(event);
    report(event);
    if (event.kind != CarrierEvent::Kind::warning) {
      session.on_transport(path.index, event.kind == CarrierEvent::Kind::up, now,
                           !only_listens(path.index));
    }
    poll_wanted = true;
  });
}

void AsyncBoard::Impl::on_overheard(Path& path, std::string_view bytes) {
  enter(Completion::How::dispatch, [&] {
    path.tap.on_sent(bytes);
    std::array<char, max_datagram + masking_room> room;
    const Text shown = without_secrets(Text(bytes.substr(0, max_datagram)), room.data());
    call(callbacks.overheard, std::string_view(shown.data(), shown.size()));
  });
}

}  // namespace r4
