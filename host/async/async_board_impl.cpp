// SPDX-License-Identifier: GPL-3.0-or-later
#include "async_board_impl.hpp"

#include <algorithm>
#include <array>
#include <string>

#include "../../protocol/messages/settings.hpp"
#include "../../transports/file_descriptor.hpp"

namespace r4 {

namespace {

// The session counts from the steady clock; since 1970 it is this much more.
SessionOptions with_clock(SessionOptions options, Time now) {
  const auto epoch = std::chrono::system_clock::now().time_since_epoch();
  options.clock_start = std::chrono::duration_cast<Time>(epoch) - now;
  return options;
}

// Not in the event loop for this long: what has come meanwhile is a backlog, and of its states only
// the newest is told.
constexpr Time held_up{std::chrono::milliseconds{50}};
// What was due so long ago is told of: two heartbeats were late.
constexpr Time very_late{std::chrono::milliseconds{200}};
// From one attempt to open a path to the next.
constexpr std::chrono::seconds open_interval{1};

}  // namespace

AsyncBoard::Impl::Impl(asio::io_context& context, std::vector<std::unique_ptr<Carrier>> transports,
                       BoardOptions options)
    : io(context),
      paths(*this, std::move(transports)),
      heartbeat_ms(options.session.timing.heartbeat_ms),
      board_timeout(std::chrono::milliseconds(options.session.timing.timeout_ms)),
      session(with_clock(std::move(options.session), steady_now()), options.role, paths.size()),
      timer(context),
      reopening(context) {}

Time AsyncBoard::Impl::time_of(Duration timeout) {
  return std::clamp<Duration>(timeout, Duration{0}, std::chrono::hours{24});
}

// --- entering the session

// By how much what was due is late; 0 inside another entry.
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
    tell_that_it_was_held_up(late);
  }
  settle();
}

// What has waited in sockets and buffers since before is passed over.
void AsyncBoard::Impl::on_sleep() {
  backlog.on_sleep();
  session.on_sleep(now);
  cancel_waits();
  poll_wanted = true;
}

void AsyncBoard::Impl::tell_that_it_was_held_up(Time late) {
  const Inside inside(depth);
  const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(late).count();
  call(callbacks.event,
       CarrierEvent{CarrierEvent::Kind::warning,
                    Problem{ErrorKind::refused, "the event loop",
                            "it was held up: what was due went out " + std::to_string(ms) +
                                " ms late, heartbeats too",
                            "a handler on this loop must return at once; where none is slow, the "
                            "computer had no time for this program"}});
}

void AsyncBoard::Impl::settle() {
  const Inside inside(depth);
  for (;;) {
    notify_all();
    // Handlers that are dispatched may start commands, whose ends are appended.
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

bool AsyncBoard::Impl::has_come(const Waits::Condition& condition) const {
  const LinkStatus& link = session.link();
  switch (condition.what) {
    case Waits::For::active:
      return session.board_role() == BoardRole::watch
                 ? is_heard(link.state)
                 : link.state == HostLinkState::active && link.in_control;
    case Waits::For::answer:
      return session.state().i2c_answer.pnum == condition.pnum;
    case Waits::For::time:
      return now >= condition.deadline;
  }
  return false;
}

// Ends the waits that are over; false if none is.
bool AsyncBoard::Impl::end_waits() {
  return waits.end_conditions(
      [this](const Waits::Condition& each) -> std::optional<Outcome> {
        if (!is_open()) return Outcome::closed;
        if (has_come(each)) return Outcome::confirmed;
        return now >= each.deadline ? std::optional(Outcome::timed_out) : std::nullopt;
      },
      now);
}

// --- what the user starts

void AsyncBoard::Impl::wait_active(Duration timeout, CompletionPtr completion) {
  enter(Completion::How::post, [&] {
    const Ticket id = waits.next_id();
    completion->listen(Cancel(weak_from_this(), id));
    waits.add({Waits::For::active, id, 0, now, now + time_of(timeout), std::move(completion)});
  });
}

void AsyncBoard::Impl::cancel(Ticket id) {
  enter(Completion::How::post, [&] {
    const Ticket ticket = waits.cancel(id, now);
    if (ticket == 0) return;
    session.cancel(ticket, now);
    notify_all();                             // with what is known of the command
    waits.end(ticket, {Outcome::cancelled});  // of a stop, which goes on
    poll_wanted = true;
  });
}

void AsyncBoard::Impl::open() {
  if (phase != Phase::made) {
    throw Error(ErrorKind::usage, paths.name(), "a board is opened once",
                "make another one for the same URL");
  }
  std::optional<Problem> problem;
  bool any = false;
  bool all = true;
  for (const auto& path : paths) {
    const bool opened = open_path(*path, problem);
    any = any || opened;
    all = all && opened;
    if (phase != Phase::made) return;  // the callback for `up` has closed the board
  }
  if (!any) throw Error(*problem);
  for (const auto& path : paths) {
    if (path->trouble) tell_trouble(*path);
    if (phase != Phase::made) return;
  }
  phase = Phase::open;
  sleep_watch = SleepWatch();
  due = steady_now();
  enter(Completion::How::post, [this] { poll_wanted = true; });
  if (!all) open_again();
}

// If at least one path is open, the others are tried again later. From then on trouble with one path
// does not touch the others. `problem`: set to the first error of all paths.
bool AsyncBoard::Impl::open_path(BoardPath& path, std::optional<Problem>& problem) {
  try {
    with_system_errors(path.carrier->name(), [&] { path.carrier->open(path); });
    path.opened = true;
    path.trouble.reset();
    return true;
  } catch (const Error& error) {
    if (phase == Phase::made && error.kind() == ErrorKind::usage) {
      paths.close();
      throw;
    }
    if (!problem) problem = error.problem();
    const bool news = !path.trouble || path.trouble->text() != error.problem().text();
    path.trouble = error.problem();
    if (news && phase == Phase::open) tell_trouble(path);
  }
  return false;
}

void AsyncBoard::Impl::open_again() {
  reopening.expires_after(open_interval);
  reopening.async_wait([self = shared_from_this()](const std::error_code& error) {
    if (error || !self->has_link()) return;
    bool all = true;
    std::optional<Problem> problem;
    for (const auto& path : self->paths) {
      if (path->opened || !self->has_link()) continue;
      self->guarded([&] { all = self->open_path(*path, problem) && all; });
    }
    if (!all && self->has_link()) self->open_again();
  });
}

Ticket AsyncBoard::Impl::leave(Time timeout) {
  phase = Phase::leaving;
  return session.leave(timeout, now);
}

void AsyncBoard::Impl::close() {
  if (phase == Phase::closed) return;
  // Said once; nobody waits for an answer.
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

// Control is taken on all paths, or on none; nothing keeps a board from being watched. Each path begins
// anew: its transport may be opened again, at another port.
void AsyncBoard::Impl::become(BoardRole role) {
  std::size_t changed = 0;
  try {
    for (; changed < paths.size(); ++changed) carrier(changed).change_role(role);
  } catch (...) {
    if (role == BoardRole::control) {
      for (std::size_t i = 0; i < changed; ++i) carrier(i).change_role(session.board_role());
      throw;
    }
    guarded([] { throw; });
    while (++changed < paths.size()) guarded([&] { carrier(changed).change_role(role); });
  }
  enter(Completion::How::post, [&] {
    session.change_role(role, now);
    if (role == BoardRole::watch) cancel_waits();
    for (const auto& path : paths) {
      if (!path->carrier->up()) continue;
      session.on_transport(path->index, true, now, !only_listens(path->index));
    }
    poll_wanted = true;
  });
}

// --- time

// The timer is only set when it must ring earlier than it will; ringing early costs one poll.
void AsyncBoard::Impl::arm() {
  const Time next = waits.next(due);
  if (armed && armed_for <= next) return;
  armed = true;
  armed_for = next;
  timer.expires_at(std::chrono::steady_clock::time_point(next));
  timer.async_wait([self = shared_from_this()](const std::error_code& error) {
    if (!error) self->on_timer();
  });
}

void AsyncBoard::Impl::on_timer() {
  if (!has_link()) return;
  armed = false;
  const bool notifies_backlog = backlog.on_timer();
  enter(Completion::How::dispatch, [this] {
    poll_wanted = true;
    tell_of_recordings();
  });
  if (notifies_backlog) notify_backlog();
}

// --- BoardPath::Owner

void AsyncBoard::Impl::on_datagram(BoardPath& path, std::string_view bytes) {
  enter(Completion::How::dispatch, [&] {
    path.tap.on_received(bytes, now);
    if (backlog.drops()) return;
    session.receive(path.index, bytes, now);
    paths[0].tap.on_packets(session.packets());
    poll_wanted = true;
    send_all();
    notify_all();  // which may be of these bytes
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

void AsyncBoard::Impl::on_carrier_event(BoardPath& path, const CarrierEvent& event) {
  enter(Completion::How::dispatch, [&] {
    path.tap.on_carrier_event(event);
    call(callbacks.event, event);
    if (event.kind != CarrierEvent::Kind::warning) {
      session.on_transport(path.index, event.kind == CarrierEvent::Kind::up, now,
                           !only_listens(path.index));
    }
    poll_wanted = true;
  });
}

void AsyncBoard::Impl::on_overheard(BoardPath& path, std::string_view bytes) {
  enter(Completion::How::dispatch, [&] {
    path.tap.on_sent(bytes);
    std::array<char, max_datagram + masking_room> room;
    const Text shown = without_secrets(Text(bytes.substr(0, max_datagram)), room.data());
    call(callbacks.overheard, std::string_view(shown.data(), shown.size()));
  });
}

}  // namespace r4
