// SPDX-License-Identifier: GPL-3.0-or-later
#include "board_link.hpp"

namespace r4 {

// A T that the board gave one of its recent heartbeats?
bool BoardLink::sent_at(std::uint32_t t_ms) const {
  for (int i = 0; i < sent_used_; ++i) {
    if (sent_[i] == t_ms) return true;
  }
  return false;
}

// Is its T one of those?
bool BoardLink::is_echo(const HostHeartbeat& heartbeat) const {
  return heartbeat.has_time && heartbeat.t != 0 && heartbeat.t <= 0xffffffffU &&
         sent_at(static_cast<std::uint32_t>(heartbeat.t));
}

// Is the T of this heartbeat a recent T of ours, an old one, or something else?
BoardLink::Freshness BoardLink::judge(const HostHeartbeat& heartbeat, bool echo_host,
                                      std::uint32_t now_ms) const {
  const bool ours = in_session(heartbeat.from) && !echo_host;
  if (ours && clock_ == Clock::own) return Freshness::no_echo;
  if (is_echo(heartbeat)) {
    const std::uint32_t t = static_cast<std::uint32_t>(heartbeat.t);
    const bool recent = now_ms - t <= timing_.timeout_ms;
    // What was sent before the link was lost says nothing of the host's being alive now. Of the same
    // millisecond, it may have been: where the host has left, that begins nothing.
    const bool this_episode =
        state_ != BoardLinkState::lost || newer(t, lost_ms_) || (t == lost_ms_ && !begun_again_);
    return recent && this_episode ? Freshness::fresh : Freshness::stale;
  }
  const bool should_echo = echo_host || (ours && clock_ == Clock::echo && has_owner());
  return should_echo ? Freshness::stale : Freshness::no_echo;
}

// Does the heartbeat go on where the session's numbers are? A session without numbers goes on with
// any heartbeat without one.
bool BoardLink::continues(const HostHeartbeat& heartbeat) const {
  if (!in_session(heartbeat.from) || heartbeat.has_pnum != has_heartbeat_pnum_) return false;
  return !heartbeat.has_pnum || (newer(heartbeat.pnum, newest_heartbeat_) &&
                                 heartbeat.pnum - newest_heartbeat_ <= command_window);
}

bool BoardLink::is_echo_host(const HostHeartbeat& heartbeat) const {
  if (continues(heartbeat)) return echo_host_;
  return heartbeat.has_pnum && heartbeat.pnum >= echo_host_first_pnum;
}

HeartbeatEffect BoardLink::begin_session(const HostHeartbeat& heartbeat, bool armed,
                                         std::uint32_t waited_ms, std::uint32_t now_ms) {
  const std::uint32_t at_ms = now_ms - waited_ms;
  // Numbers that go on are the same count, whatever else has changed: the gate does not move back.
  echo_host_ = is_echo_host(heartbeat);
  if (continues(heartbeat) && heartbeat.has_pnum) {
    spend(heartbeat.pnum);
  } else {
    has_baseline_ = heartbeat.has_pnum;
    newest_ = heartbeat.pnum;
    executed_bits_ = 0;
  }
  has_session_ = true;
  owner_ = heartbeat.from;
  armed_ = armed;
  clock_ = Clock::unknown;
  last_executed_ = 0;
  refused_used_ = refused_next_ = 0;
  numbers_in_doubt_ = false;
  begun_again_ = false;
  has_heartbeat_pnum_ = heartbeat.has_pnum;
  first_echo_ = heartbeat.pnum;
  began_ms_ = now_ms;
  marks_used_ = 0;
  newest_echo_ms_ = at_ms - timing_.timeout_ms;
  state_ = BoardLinkState::active;
  send_now_ = true;
  feed(heartbeat, at_ms);
  return HeartbeatEffect::new_session;
}

// `at_ms`: when it had come, at the earliest. A command that it overtook is never taken for younger
// than it is by that, and one that came behind it, in the same backlog, has a newer number.
void BoardLink::feed(const HostHeartbeat& heartbeat, std::uint32_t at_ms) {
  fed_ms_ = at_ms;
  const std::uint32_t t = static_cast<std::uint32_t>(heartbeat.t);
  const bool known = is_echo(heartbeat);
  if (known && newer(t, newest_echo_ms_)) newest_echo_ms_ = t;
  if (!echo_host_ && clock_ == Clock::unknown && heartbeat.has_time && heartbeat.t != 0) {
    clock_ = known ? Clock::echo : Clock::own;
  }
  if (!heartbeat.has_pnum) return;
  newest_heartbeat_ = heartbeat.pnum;
  // The marks last for the limit at any rate of heartbeats. Between two marks a heartbeat counts as
  // come at the earlier one, so a command is never taken for younger than it is. When the oldest
  // mark is dropped, the next is past the limit itself.
  constexpr std::uint32_t spacing_ms = late_limit_ms / (mark_count - 1) + 1;
  if (marks_used_ != 0 && at_ms - marks_[marks_used_ - 1].at_ms < spacing_ms) {
    marks_[marks_used_ - 1].pnum = heartbeat.pnum;
    return;
  }
  if (marks_used_ == mark_count) {
    // Commands from before the oldest mark are late anyway. The window follows it, so that a host
    // that commanded nothing for hours is not ahead of it.
    if (has_baseline_ && marks_[0].pnum - newest_ > command_window / 2) spend(marks_[0].pnum);
    for (int i = 1; i < mark_count; ++i) marks_[i - 1] = marks_[i];
    --marks_used_;
  }
  marks_[marks_used_++] = Mark{heartbeat.pnum, at_ms};
}

HeartbeatEffect BoardLink::on_heartbeat(const HostHeartbeat& heartbeat, std::uint32_t now_ms) {
  const bool continuing = continues(heartbeat);
  const bool echo_host = is_echo_host(heartbeat);
  Freshness freshness = judge(heartbeat, echo_host, now_ms);
  std::uint32_t waited_ms = heartbeat.waited_ms;
  if (freshness == Freshness::fresh) {  // it came after what it echoes was sent
    const std::uint32_t echo_ms = now_ms - static_cast<std::uint32_t>(heartbeat.t);
    if (echo_ms < waited_ms) waited_ms = echo_ms;
  }
  const bool timely = waited_ms < timing_.timeout_ms;
  if (!timely) freshness = Freshness::stale;
  // The session has been heard already, then.
  const std::uint32_t silent_ms = now_ms - fed_ms_;
  const std::uint32_t feeds_ms = now_ms - (waited_ms < silent_ms ? waited_ms : silent_ms);
  // Who has echoed and then knows nothing to echo has begun again, even if its numbers would fit.
  if (continuing && echo_host && armed_ && heartbeat.t == 0) begun_again_ = true;

  switch (state_) {
    case BoardLinkState::connecting:
      // The first word of a host. An echo host's commands wait for its echo of a T of this boot;
      // one that echoes already speaks of another boot.
      if (!timely || (echo_host && heartbeat.t != 0)) return HeartbeatEffect::stale;
      return begin_session(heartbeat, !echo_host, waited_ms, now_ms);

    case BoardLinkState::active:
      if (heartbeat.from != owner_) return HeartbeatEffect::busy;
      if (freshness == Freshness::stale) return HeartbeatEffect::stale;
      if (continuing && !begun_again_) {
        if (!armed_) {
          armed_ = true;
          first_echo_ = heartbeat.pnum;
          spend(heartbeat.pnum);
        }
        feed(heartbeat, feeds_ms);
        return HeartbeatEffect::fed;
      }
      // The same place, other numbers, and an echo newer than any before: the host has restarted, or
      // it is another, since on a bus all hosts are at one place. It waits until the owner is lost.
      if (echo_host && newer(static_cast<std::uint32_t>(heartbeat.t), newest_echo_ms_) &&
          (continuing || !near_newest_heartbeat(heartbeat.pnum))) {
        return armed_ ? HeartbeatEffect::busy : begin_session(heartbeat, true, waited_ms, now_ms);
      }
      return HeartbeatEffect::stale;

    case BoardLinkState::lost: {
      if (freshness == Freshness::stale) return HeartbeatEffect::stale;
      const bool other_clock = clock_ == Clock::echo && freshness == Freshness::no_echo;
      const bool near = !heartbeat.has_pnum || heartbeat.pnum - newest_heartbeat_ <= resume_window;
      const bool same = continuing && near && armed_ && !begun_again_ && !other_clock;
      if (!same) return begin_session(heartbeat, true, waited_ms, now_ms);
      state_ = BoardLinkState::active;
      send_now_ = true;
      newest_echo_ms_ = feeds_ms - timing_.timeout_ms;
      if (heartbeat.has_pnum) spend(heartbeat.pnum);  // what was sent before the outage
      numbers_in_doubt_ = !heartbeat.has_pnum;
      feed(heartbeat, feeds_ms);
      return HeartbeatEffect::resumed;
    }
  }
  return HeartbeatEffect::stale;
}

// A late or repeated heartbeat of this session, not one of another.
bool BoardLink::near_newest_heartbeat(std::uint32_t pnum) const {
  return has_heartbeat_pnum_ &&
         (pnum - newest_heartbeat_ <= command_window || newest_heartbeat_ - pnum <= command_window);
}

bool BoardLink::in_window(std::uint32_t pnum) const {
  return !has_baseline_ || (newer(pnum, newest_) && pnum - newest_ <= command_window);
}

bool BoardLink::is_next(std::uint32_t pnum) const {
  return (has_baseline_ && pnum - newest_ <= memory) ||
         (has_heartbeat_pnum_ && pnum - newest_heartbeat_ <= memory);
}

bool BoardLink::begins_anew(std::uint32_t pnum) const {
  return numbers_in_doubt_ && !in_window(pnum) && newest_ - pnum >= memory;
}

Admission BoardLink::admit(Source from, std::uint32_t pnum, std::uint32_t now_ms,
                           Refusal& code) const {
  // Whatever the link is now: a number that was executed is answered so, and the host knows.
  const std::uint32_t behind = newest_ - pnum;
  const bool ours = in_session(from);
  if (ours && has_baseline_ && behind < memory && ((executed_bits_ >> behind) & 1U) != 0) {
    code = Refusal::duplicate;
    return Admission::refuse;
  }
  const bool spent = ours && has_baseline_ && !newer(pnum, newest_);
  if (spent) code = code_of_spent(pnum);
  if (spent && code != Refusal::stale) return Admission::refuse;
  if (state_ != BoardLinkState::active) {
    code = Refusal::safe;
    return Admission::refuse;
  }
  if (!ours) {
    code = Refusal::busy;
    return Admission::refuse;
  }
  if (!armed_) return Admission::drop;
  if (!in_window(pnum) && !begins_anew(pnum)) {
    code = Refusal::stale;
    return Admission::refuse;
  }
  for (int i = 0; i < marks_used_; ++i) {
    if (now_ms - marks_[i].at_ms > late_limit_ms && newer(marks_[i].pnum, pnum)) {
      code = Refusal::stale;
      return Admission::refuse;
    }
  }
  return Admission::execute;
}

// Commands up to `pnum` are not to be executed any more.
void BoardLink::spend(std::uint32_t pnum) {
  if (begins_anew(pnum)) has_baseline_ = false;
  numbers_in_doubt_ = false;
  if (has_baseline_ && !newer(pnum, newest_)) return;
  const std::uint32_t ahead = has_baseline_ ? pnum - newest_ : memory;
  executed_bits_ = ahead < memory ? executed_bits_ << ahead : 0;
  newest_ = pnum;
  has_baseline_ = true;
}

void BoardLink::refused(Source from, std::uint32_t pnum, Refusal code) {
  if (!in_session(from) || !(in_window(pnum) || begins_anew(pnum))) return;
  spend(pnum);
  refused_[refused_next_] = pnum;
  refused_codes_[refused_next_] = code;
  refused_next_ = (refused_next_ + 1) % refused_memory;
  if (refused_used_ < refused_memory) ++refused_used_;
}

// Why is a number that is spent not executed?
Refusal BoardLink::code_of_spent(std::uint32_t pnum) const {
  for (int i = 0; i < refused_used_; ++i) {
    if (refused_[i] == pnum) return refused_codes_[i];
  }
  return Refusal::stale;
}

void BoardLink::executed(std::uint32_t pnum) {
  spend(pnum);
  const std::uint32_t behind = newest_ - pnum;
  if (behind < memory) executed_bits_ |= std::uint64_t{1} << behind;
  if (behind == 0) last_executed_ = pnum;
}

void BoardLink::lose(std::uint32_t now_ms) {
  state_ = BoardLinkState::lost;
  lost_ms_ = now_ms;
  send_now_ = true;
}

bool BoardLink::poll(std::uint32_t now_ms) {
  if (state_ != BoardLinkState::active || now_ms - fed_ms_ < timing_.timeout_ms) return false;
  lose(now_ms);
  return true;
}

bool BoardLink::port_lost(std::uint8_t port, std::uint32_t now_ms) {
  if (state_ != BoardLinkState::active || owner_.port != port) return false;
  lose(now_ms);
  return true;
}

bool BoardLink::may_leave(const HostHeartbeat& farewell, std::uint32_t now_ms) const {
  return judge(farewell, echo_host_, now_ms) == Freshness::fresh &&
         reached(static_cast<std::uint32_t>(farewell.t), began_ms_);
}

void BoardLink::leave(std::uint32_t now_ms) {
  if (state_ != BoardLinkState::active) return;
  begun_again_ = true;
  lose(now_ms);
}

bool BoardLink::heartbeat_due(std::uint32_t now_ms) const {
  if (send_now_ || !any_sent_) return true;
  const std::uint32_t since = now_ms - last_sent_ms_;
  if (since >= timing_.heartbeat_ms) return true;
  // An echo host whose echo stays away is asked again: one lost heartbeat must not become stale.
  const bool waiting =
      state_ == BoardLinkState::active && echo_host_ && newer(last_sent_ms_, newest_echo_ms_);
  return waiting && since >= echo_retry_ms;
}

void BoardLink::heartbeat_sent(std::uint32_t t_ms) {
  any_sent_ = true;
  send_now_ = false;
  last_sent_ms_ = t_ms;
  // A session may last for months, and so may the time without one.
  keep_near(began_ms_, t_ms);
  keep_near(lost_ms_, t_ms);
  keep_near(newest_echo_ms_, t_ms);
  remember_sent(t_ms);
}

bool BoardLink::wants_answer(const HostHeartbeat& heartbeat, std::uint32_t now_ms) const {
  if (any_answered_ && now_ms - last_answered_ms_ < answer_spacing_ms) return false;
  return state_ != BoardLinkState::active || (heartbeat.has_time && heartbeat.t == 0);
}

void BoardLink::heartbeat_answered(std::uint32_t t_ms) {
  any_answered_ = true;
  last_answered_ms_ = t_ms;
  remember_sent(t_ms);
}

void BoardLink::remember_sent(std::uint32_t t_ms) {
  if (state_ == BoardLinkState::connecting || sent_at(t_ms)) return;  // connecting: those carry T:0
  sent_[sent_next_] = t_ms;
  sent_next_ = (sent_next_ + 1) % sent_count;
  if (sent_used_ < sent_count) ++sent_used_;
}

bool BoardLink::session_of(Source from, std::uint32_t& first_echo) const {
  first_echo = first_echo_;
  return in_session(from) && armed_ && has_heartbeat_pnum_;
}

std::uint32_t BoardLink::due_in(std::uint32_t now_ms) const {
  if (heartbeat_due(now_ms)) return 0;
  const std::uint32_t since = now_ms - last_sent_ms_;
  std::uint32_t due = timing_.heartbeat_ms - since;
  if (state_ == BoardLinkState::active) {
    if (echo_host_ && newer(last_sent_ms_, newest_echo_ms_) && echo_retry_ms - since < due) {
      due = echo_retry_ms - since;
    }
    const std::uint32_t silent = now_ms - fed_ms_;
    const std::uint32_t left = silent < timing_.timeout_ms ? timing_.timeout_ms - silent : 0;
    if (left < due) due = left;
  }
  return due;
}

}  // namespace r4
