// SPDX-License-Identifier: GPL-3.0-or-later
#include "async_board_impl.hpp"

#include <algorithm>
#include <array>
#include <string>

#include "../protocol/messages/settings.hpp"
#include "../transports/file_descriptor.hpp"

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
      heartbeat_ms(options.session.timing.heartbeat_ms),
      board_timeout(std::chrono::milliseconds(options.session.timing.timeout_ms)),
      session(with_clock(std::move(options.session), steady_now()), options.role,
              transports.size()),
      timer(context),
      reopening(context) {
  for (std::unique_ptr<Carrier>& each : transports) {
    paths.push_back(std::make_unique<BoardPath>(*this, paths.size(), std::move(each)));
  }
}

Time AsyncBoard::Impl::time_of(Duration timeout) {
  return std::clamp<Duration>(timeout, Duration{0}, std::chrono::hours{24});
}

// --- entering the session

// By how much what was due is late; 0 inside another entry.
Time AsyncBoard::Impl::begin_entry(Completion::How way) {
  if (depth == 0) how = way;
  session.on_trouble(trouble());
  const Time before = std::exchange(now, steady_now());
  if (now - before > held_up) in_backlog = true;
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
  waking = 2;
  backlog_size = 0;
  session.on_sleep(now);
  for (Waiter& waiter : waiters) give_up(waiter);
  waiters.clear();
  poll_wanted = true;
}

void AsyncBoard::Impl::tell_that_it_was_held_up(Time late) {
  const Inside inside(depth);
  const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(late).count();
  call(event_callbacks,
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
    tell_news();
    // Handlers that are dispatched may start commands, whose ends are appended.
    while (!ended.empty()) {
      Ended first = std::move(ended.front());
      ended.erase(ended.begin());
      guarded([&] { first.completion.release()->complete(first.result, how); });
    }
    if (poll_wanted && has_link()) {
      poll_wanted = false;
      session.poll(now);
      send_all();
      due = session.next_poll(now);
    } else if (!end_waits() && !session.effects().any_news()) {
      break;
    }
  }
  if (has_link()) arm();
}

bool AsyncBoard::Impl::has_come(const Waiter& waiter) const {
  const LinkStatus& link = session.link();
  switch (waiter.what) {
    case Waiter::For::active:
      return session.board_role() == BoardRole::watch
                 ? is_heard(link.state)
                 : link.state == HostLinkState::active && link.in_control;
    case Waiter::For::answer:
      return session.state().i2c_answer.pnum == waiter.pnum;
    case Waiter::For::time:
      return now >= waiter.deadline;
  }
  return false;
}

// Ends the waits that are over; false if none is.
bool AsyncBoard::Impl::end_waits() {
  bool any = false;
  for (std::size_t i = 0; i < waiters.size();) {
    Waiter& waiter = waiters[i];
    const Outcome outcome = !is_open()         ? Outcome::closed
                            : has_come(waiter) ? Outcome::confirmed
                                               : Outcome::timed_out;
    if (outcome == Outcome::timed_out && now < waiter.deadline) {
      ++i;
      continue;
    }
    any = true;
    ended.push_back({{outcome, Refusal::none, now - waiter.started}, std::move(waiter.completion)});
    waiters.erase(waiters.begin() + static_cast<std::ptrdiff_t>(i));
  }
  return any;
}

void AsyncBoard::Impl::give_up(Waiter& waiter) {
  ended.push_back(
      {{Outcome::cancelled, Refusal::none, now - waiter.started}, std::move(waiter.completion)});
}

// --- what the user starts

void AsyncBoard::Impl::wait_active(Duration timeout, CompletionPtr completion) {
  enter(Completion::How::post, [&] {
    const Ticket id = next_waiter++;
    completion->listen(Cancel(weak_from_this(), id));
    waiters.push_back(
        {Waiter::For::active, id, 0, now, now + time_of(timeout), std::move(completion)});
  });
}

void AsyncBoard::Impl::cancel(Ticket id) {
  enter(Completion::How::post, [&] {
    const auto waiter =
        std::find_if(waiters.begin(), waiters.end(), [id](const Waiter& w) { return w.id == id; });
    if (waiter != waiters.end()) {
      give_up(*waiter);
      waiters.erase(waiter);
      return;
    }
    const auto command =
        std::find_if(waiting.begin(), waiting.end(), [id](const Waiting& w) { return w.id == id; });
    if (command == waiting.end()) return;
    const Ticket ticket = command->ticket;
    session.cancel(ticket, now);
    on_result(ticket, {Outcome::cancelled});  // of a stop, which goes on
    poll_wanted = true;
  });
}

void AsyncBoard::Impl::open() {
  if (phase != Phase::made) {
    throw Error(ErrorKind::usage, name(), "a board is opened once",
                "make another one for the same URL");
  }
  std::optional<Problem> problem;
  bool any = false;
  bool all = true;
  for (const auto& path : paths) {
    const bool opened = open_path(*path, problem);
    any = any || opened;
    all = all && opened;
    if (phase != Phase::made) return;  // closed by the callback that was told that it is open
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
      for (const auto& each : paths) each->carrier->close();
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
  for (const auto& path : paths) path->carrier->close();
  timer.cancel();
  reopening.cancel();
  how = Completion::How::post;
  enter(Completion::How::post, [this] { session.end_all(now); });
}

// All paths, or none. Each begins anew: its transport may be opened again, at another port.
void AsyncBoard::Impl::become(BoardRole role) {
  std::size_t changed = 0;
  try {
    for (; changed < paths.size(); ++changed) carrier(changed).change_role(role);
  } catch (const Error&) {
    for (std::size_t i = 0; i < changed; ++i) carrier(i).change_role(session.board_role());
    throw;
  }
  enter(Completion::How::post, [&] {
    session.change_role(role, now);
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
  Time next = due;
  for (const Waiter& waiter : waiters) next = std::min(next, waiter.deadline);
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
  if (waking != 0) --waking;
  enter(Completion::How::dispatch, [this] {
    poll_wanted = true;
    tell_of_recordings();
  });
  // Twice without a word that the transport is drained: it may be one that never tells.
  undrained = backlog_size == 0 ? 0 : undrained + 1;
  if (undrained >= 2) tell_backlog();
}

// --- BoardPath::Owner

void AsyncBoard::Impl::on_datagram(BoardPath& path, std::string_view bytes) {
  enter(Completion::How::dispatch, [&] {
    path.tap.on_received(bytes, now);
    if (waking != 0) return;
    session.receive(path.index, bytes, now);
    paths[0]->tap.on_packets(session.packets());
    poll_wanted = true;
    send_all();
    tell_news();  // which may be of these bytes
  });
}

void AsyncBoard::Impl::on_drained() {
  in_backlog = false;
  waking = 0;
  undrained = 0;
  tell_backlog();
}

void AsyncBoard::Impl::tell_backlog() {
  if (backlog_size == 0) return;
  const std::size_t size = std::exchange(backlog_size, 0);
  enter(Completion::How::dispatch, [&] {
    Datagram datagram;
    if (is_open() && read_datagram(Text(backlog.data(), size), datagram)) {
      call(state_callbacks, session.state(), datagram);
    }
  });
}

void AsyncBoard::Impl::on_carrier_event(BoardPath& path, const CarrierEvent& event) {
  enter(Completion::How::dispatch, [&] {
    path.tap.on_carrier_event(event);
    call(event_callbacks, event);
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
    call(overheard_callbacks, std::string_view(shown.data(), shown.size()));
  });
}

}  // namespace r4
