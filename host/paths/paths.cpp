// SPDX-License-Identifier: GPL-3.0-or-later
#include "paths.hpp"

#include <algorithm>

namespace r4 {

const char* to_text(PathState state) {
  constexpr const char* names[] = {"down", "asking", "other board", "silent", "carrying"};
  static_assert(std::size(names) == static_cast<std::size_t>(PathState::carrying) + 1);
  const auto index = static_cast<std::size_t>(state);
  return index < std::size(names) ? names[index] : "unknown";
}

void Paths::on_transport(std::size_t index, bool up, bool can_ask, Time now) {
  Path& path = paths_[index];
  path.up = up;
  path.can_ask = can_ask;
  path.known = up && (!can_ask || is_only());
  path.other = path.connecting = false;
  path.questions.answered = path.questions.in_doubt = false;
  path.questions.unanswered = 0;
  path.clock.reset();
  path.heard = path.heard_until = path.busy.until = Time{0};
  path.questions.ask_at = path.known || !up ? Time::max() : now;
  if (path.known && first_answer_.count() == 0) first_answer_ = now;
  anew_ = anew_ || all_down();
  if (!up) return;
  // Numbers may restart, and a lease may have ended.
  news_.restart(index);
  path.lease.renew(now);
}

void Paths::on_sleep(Time now) {
  for (std::size_t i = 0; i < paths_.size(); ++i) {
    Path& path = paths_[i];
    path.clock.reset();
    path.connecting = false;
    path.heard = path.heard_until = path.busy.until = Time{0};
    path.questions.open = IdentityQuestion();
    if (path.up && path.can_ask && (path.questions.answered || !path.known))
      path.questions.ask_at = now;
    news_.restart(i);
    path.lease.renew(now);
  }
  clock_.reset();
  news_.forget();
  own_ = {};
  anew_ = true;
}

PathSet Paths::to_ask(Time now) const {
  return those(
      [now](const Path& path) { return path.up && path.can_ask && now >= path.questions.ask_at; });
}

void Paths::asked(std::size_t index, std::uint32_t pnum, bool sent, Time now) {
  Path& path = paths_[index];
  PathQuestions& questions = path.questions;
  if (!sent && questions.ask_at > now) return;  // the question was not due here
  const Time again = now + (path.other ? ask_other_interval : ask_interval);
  questions.asked_at = now;
  questions.ask_at = path.known && sent ? Time::max() : again;
  if (!sent) return;
  questions.open.asked(pnum, now);
  // Only questions in doubt count: without datagrams the board may be unable to answer.
  questions.unanswered += questions.in_doubt && questions.unanswered < most_unanswered ? 1 : 0;
  questions.in_doubt = false;
}

// Q:ID is sent at most ten times a second.
void Paths::ask_soon(Path& path, Time now) {
  if (!path.can_ask) return;
  PathQuestions& questions = path.questions;
  questions.in_doubt = true;
  questions.ask_at = std::min(questions.ask_at, std::max(now, questions.asked_at + ask_interval));
}

Paths::Admission Paths::admit_identity(std::size_t index, const Identity& identity,
                                       std::uint32_t t_ms, Time now) {
  Path& path = paths_[index];
  if (!path.up) return Admission::no;
  const std::optional<Time> asked = path.questions.open.answered(identity);
  // An answer to another program, or a duplicate, does not prove whether the board has restarted.
  if (!asked && path.can_ask) return path.known ? Admission::yes : Admission::no;
  const std::string_view id(identity.board_id.data(), identity.board_id.size());
  if (path.board_id != id) path.board_id = id;
  // The only path may later lead to another board. With other paths, the id may change only before
  // the session begins, and if no other path leads to the session's board.
  const bool others = (known() & ~path_bit(index)) != 0;
  if (!id_ || is_only() || (!begun_ && !others)) id_ = id;
  path.other = *id_ != id;
  path.known = !path.other;
  if (path.other) {
    path.questions.ask_at = path.can_ask ? now + ask_other_interval : Time::max();
    return Admission::no;
  }
  path.questions.ask_at = Time::max();
  if (first_answer_.count() == 0) first_answer_ = now;
  if (!asked) return Admission::yes;
  path.questions.answered = true;
  path.questions.unanswered = 0;
  path.questions.round_trip = now - *asked;
  const bool later = *asked > proven_;
  // The answer was sent between the question and now, which bounds T.
  const bool same = clock_ ? clock_->fits(t_ms, *asked, now, PathClock::restart_tolerance_ms)
                           : fits_others(path, t_ms, now);
  if (!same && !later) {
    ask_soon(path, now);
    return Admission::yes;
  }
  if (!same) begin_boot(t_ms, now);
  set_clock(index, t_ms, now);
  proven_ = now;
  compare_those_that_listen(t_ms, now);
  return same ? Admission::yes : Admission::restarted;
}

bool Paths::poll(Time now) {
  if (begun_ || known() == 0 || two_boards()) return false;
  const bool asking = std::any_of(paths_.begin(), paths_.end(), [this](const Path& path) {
    const bool compared = path.can_ask || path.clock || is_only();
    return path.up && !(path.known && compared);
  });
  if (asking && now < first_answer_ + patience) return false;
  begun_ = true;
  return true;
}

Time Paths::next(Time now) const {
  Time next = Time::max();
  for (const Path& path : paths_) {
    if (path.up && path.can_ask)
      next = std::min(next, std::max(path.questions.ask_at, now + Time{1000}));
    if (is_heard(path, now)) next = std::min(next, path.heard_until);
  }
  const Time begins = first_answer_ + patience;
  if (!begun_ && known() != 0 && begins > now) next = std::min(next, begins);
  return next;
}

bool Paths::fits_others(const Path& path, std::uint32_t t_ms, Time now) const {
  return std::all_of(paths_.begin(), paths_.end(), [&](const Path& each) {
    const bool knows = &each != &path && each.known && each.clock && each.boot == boot_;
    return !knows || in_clock(each, t_ms, now);
  });
}

bool Paths::fits(const Path& path, std::uint32_t t_ms, Time now) const {
  if (!begun_) return fits_others(path, t_ms, now);
  return !clock_ || clock_->fits(t_ms, now, now, late_of(path));
}

void Paths::set_clock(std::size_t index, std::uint32_t t_ms, Time now) {
  Path& path = paths_[index];
  path.clock = {t_ms, to_ms(now)};
  if (path.boot == boot_) return;
  path.boot = boot_;
  news_.restart(index);
}

// In whole milliseconds, as in HostLink, so that the path and the link become silent together.
void Paths::hear(Path& path, Time now) const {
  path.heard = now;
  path.heard_until = std::chrono::floor<std::chrono::milliseconds>(now) + timeout_;
}

void Paths::begin_boot(std::uint32_t t_ms, Time now) {
  ++boot_;
  news_.forget();
  own_ = {};
  clock_ = {t_ms, to_ms(now)};
}

// A listening path with another clock leads to another board or shows an earlier boot.
void Paths::compare_those_that_listen(std::uint32_t t_ms, Time now) {
  anew_ = false;
  for (Path& each : paths_) {
    if (each.can_ask || !each.clock || in_clock(each, t_ms, now)) continue;
    each.clock.reset();
    if (!begun_) turn_away(each);
  }
}

void Paths::turn_away(Path& path) {
  if (path.can_ask) return ask_soon(path, path.questions.asked_at);
  path.other = true;
  path.known = false;
}

Paths::Admission Paths::admit(std::size_t index, std::uint32_t pnum, std::uint32_t t_ms, Time now) {
  Path& path = paths_[index];
  Admission admission = Admission::yes;
  if (!is_of_this_boot(path, t_ms, now)) {
    if (!path.up || !is_believed(path)) {
      if (path.known) ask_soon(path, now);
      return Admission::no;
    }
    if (!fits(path, t_ms, now)) {
      // The board has restarted if this path has carried and no other path carries.
      const bool carried = path.clock && path.boot == boot_;
      const bool others_carry = (carrying(now) & ~path_bit(index)) != 0;
      if (!carried && !anew_) turn_away(path);
      if ((!carried && !anew_) || others_carry) return Admission::no;
      begin_boot(t_ms, now);
      proven_ = now;
      admission = Admission::restarted;
    }
    path.other = false;
    path.known = true;
  }
  anew_ = false;
  path.connecting = false;
  set_clock(index, t_ms, now);
  hear(path, now);
  news_.on_number(index, pnum);
  return begun_ ? admission : Admission::no;
}

// A delayed heartbeat must not end the session. If the board's heartbeats are recent, Q:ID decides.
bool Paths::admit_connecting(std::size_t index, Time now) {
  Path& path = paths_[index];
  if (!path.known) return false;
  hear(path, now);
  if (!path.connecting) {
    path.connecting = true;
    news_.restart(index);
  }
  const bool believed = is_believed(path);
  if (!believed) ask_soon(path, now);
  const auto lives = [now](const Path& each) { return is_heard(each, now) && !each.connecting; };
  if (!begun_ || those(lives) != 0) return false;
  const bool recent =
      link_.echo() != 0 && r4::is_heard(link_.state()) && clock_ &&
      -clock_->ahead(link_.echo(), now) <= static_cast<std::int32_t>(to_ms(timeout_));
  if (!believed && recent) return false;
  news_.on_connecting();
  return true;
}

bool Paths::admit_answer(std::size_t index, std::uint32_t pnum, std::uint32_t t_ms, bool counts,
                         Time now) {
  Path& path = paths_[index];
  if (!is_of_this_boot(path, t_ms, now)) {
    if (!is_believed(path)) {
      if (path.known) ask_soon(path, now);
      return false;
    }
    // On a bus, the answer to a lease precedes the first state.
    if (!path.known || path.clock) return false;
    if (!fits(path, t_ms, now)) {
      if (!anew_) turn_away(path);
      return false;
    }
  }
  hear(path, now);
  if (counts) news_.on_answer(index, pnum);
  return begun_;
}

bool Paths::is_newest(std::size_t index, std::uint32_t t_ms, Time now) {
  if (!news_.is_newest(index, t_ms)) return false;
  clock_ = {t_ms, to_ms(now)};
  return true;
}

Time Paths::next_lease() const {
  Time next = Time::max();
  for (std::size_t i = 0; i < paths_.size(); ++i) {
    if ((speaking() & path_bit(i)) != 0) next = std::min(next, paths_[i].lease.next());
  }
  return next;
}

LinkCauses Paths::lease_causes(Time now) const {
  LinkCauses all;
  if (streaming(now)) return all;
  for (const Path& path : paths_) {
    if (const auto cause = path.lease.cause(now)) all.set(*cause);
  }
  return all;
}

bool Paths::refuses(const Path& path, Time now) const {
  if (now >= path.busy.until) return false;
  const bool comparable = path.busy.board_ms && own_ && now - own_->at < own_state_memory;
  return !comparable || newer(*path.busy.board_ms, own_->t_ms);
}

std::optional<Time> Paths::all_busy_until(Time now) const {
  Time until = now + busy_memory;
  for (const Path& path : paths_) {
    if (!is_heard(path, now)) continue;
    if (!refuses(path, now)) return std::nullopt;
    until = std::min(until, path.busy.until);
  }
  return until;
}

PathState Paths::state(const Path& path, Time now) const {
  if (!path.up) return PathState::down;
  if (path.other) return PathState::other_board;
  if (!path.known) return PathState::asking;
  return is_heard(path, now) ? PathState::carrying : PathState::silent;
}

PathStatus Paths::report(std::size_t index, Time now) const {
  const auto microseconds = [](Time time) { return static_cast<double>(time.count()); };
  const Path& path = paths_[index];
  PathStatus report;
  report.state = state(path, now);
  report.age_us = path.heard.count() != 0 ? microseconds(now - path.heard) : 0;
  report.busy = now < path.busy.until;
  report.board_id = path.board_id;
  report.packets = news_.counters(index);
  report.copies = news_.copies(index);
  report.round_trip_us = microseconds(path.questions.round_trip);
  return report;
}

}  // namespace r4
