// SPDX-License-Identifier: GPL-3.0-or-later
#include "board_link.hpp"

namespace r4 {

bool BoardLink::is_echo(std::uint64_t t) const {
  for (int i = 0; t != 0 && i < sent_used_; ++i) {
    if (sent_[i] == t) return true;
  }
  return false;
}

BoardLink::Freshness BoardLink::judge(const HostHeartbeat& heartbeat, std::uint32_t now_ms) const {
  const bool paper = heartbeat.host.sid == no_session;
  if (heartbeat.waited_ms >= timing_.timeout_ms || (!paper && !heartbeat.has_pnum)) {
    return Freshness::stale;
  }
  const bool ours = is_session_of(heartbeat.host);
  if (paper && ours && clock_ == Clock::own) return Freshness::no_echo;
  if (is_echo(heartbeat.t)) {
    const std::uint32_t t = static_cast<std::uint32_t>(heartbeat.t);
    const bool recent = now_ms - t <= timing_.timeout_ms;
    // A heartbeat sent before the loss does not prove that the host is alive after it.
    const bool since_loss = state_ != BoardLinkState::lost || reached(t, lost_ms_);
    return recent && since_loss ? Freshness::fresh : Freshness::stale;
  }
  const bool must_echo = !paper || (ours && clock_ == Clock::echo && has_owner());
  return must_echo ? Freshness::stale : Freshness::no_echo;
}

// True if the heartbeat is newer than the session's newest heartbeat. A heartbeat of a paper host
// that sends no numbers always continues.
bool BoardLink::continues(const HostHeartbeat& heartbeat) const {
  if (heartbeat.has_pnum != has_heartbeat_pnum_) return false;
  return !heartbeat.has_pnum || newer(heartbeat.pnum, newest_heartbeat_);
}

bool BoardLink::has_left(HostId host) const {
  for (const SessionId sid : left_) {
    if (sid != no_session && sid == host.sid) return true;
  }
  return false;
}

HeartbeatEffect BoardLink::on_heartbeat(const HostHeartbeat& heartbeat, std::uint32_t now_ms) {
  const bool paper = heartbeat.host.sid == no_session;
  const bool ours = is_session_of(heartbeat.host);
  const Freshness freshness = judge(heartbeat, now_ms);
  // The earliest possible arrival: after the echoed T was sent, and after the previous heartbeat.
  std::uint32_t waited_ms = heartbeat.waited_ms;
  if (freshness == Freshness::fresh) {
    const std::uint32_t echo_ms = now_ms - static_cast<std::uint32_t>(heartbeat.t);
    if (echo_ms < waited_ms) waited_ms = echo_ms;
  }
  if (ours && now_ms - fed_ms_ < waited_ms) waited_ms = now_ms - fed_ms_;
  const std::uint32_t at_ms = now_ms - waited_ms;

  if (state_ == BoardLinkState::active && !ours) return HeartbeatEffect::busy;
  if (freshness == Freshness::stale || has_left(heartbeat.host)) {
    const bool has_fresh_t = state_ == BoardLinkState::active && heartbeat.t != 0;
    return has_fresh_t ? HeartbeatEffect::stale : HeartbeatEffect::unheard;
  }
  if (state_ == BoardLinkState::active) {
    if (!continues(heartbeat)) return paper ? HeartbeatEffect::stale : HeartbeatEffect::repeated;
    feed(heartbeat, at_ms);
    return HeartbeatEffect::fed;
  }
  if (ours && !paper) {
    if (!continues(heartbeat)) return HeartbeatEffect::stale;  // a late duplicate
    resume(heartbeat, at_ms);
    return HeartbeatEffect::resumed;
  }
  begin_session(heartbeat, at_ms);
  return HeartbeatEffect::new_session;
}

void BoardLink::begin_session(const HostHeartbeat& heartbeat, std::uint32_t at_ms) {
  has_session_ = true;
  host_ = heartbeat.host;
  clock_ = Clock::unknown;
  has_heartbeat_pnum_ = heartbeat.has_pnum;
  first_heartbeat_ = newest_ = heartbeat.pnum;
  has_baseline_ = heartbeat.has_pnum;
  executed_bits_ = 0;
  refused_used_ = refused_next_ = 0;
  last_executed_ = 0;
  marks_used_ = 0;
  resume(heartbeat, at_ms);
}

void BoardLink::resume(const HostHeartbeat& heartbeat, std::uint32_t at_ms) {
  state_ = BoardLinkState::active;
  send_now_ = true;
  newest_echo_ms_ = at_ms - timing_.timeout_ms;
  if (heartbeat.has_pnum) spend(heartbeat.pnum);  // commands sent before the outage are spent
  feed(heartbeat, at_ms);
}

// `at_ms`: the earliest possible arrival, so that no overtaken command's age is underestimated. A
// command that arrived later in the same backlog has a newer number.
void BoardLink::feed(const HostHeartbeat& heartbeat, std::uint32_t at_ms) {
  fed_ms_ = at_ms;
  const std::uint32_t t = static_cast<std::uint32_t>(heartbeat.t);
  const bool known = is_echo(heartbeat.t);
  if (known && newer(t, newest_echo_ms_)) newest_echo_ms_ = t;
  if (clock_ == Clock::unknown && heartbeat.t != 0) clock_ = known ? Clock::echo : Clock::own;
  if (!heartbeat.has_pnum) return;
  newest_heartbeat_ = heartbeat.pnum;
  // The marks cover late_limit_ms at any heartbeat rate. A heartbeat between two marks counts as
  // arrived at the earlier mark. When the oldest mark is dropped, the next mark is past the limit.
  constexpr std::uint32_t spacing_ms = late_limit_ms / (mark_count - 1) + 1;
  if (marks_used_ != 0 && at_ms - marks_[marks_used_ - 1].at_ms < spacing_ms) {
    marks_[marks_used_ - 1].pnum = heartbeat.pnum;
    return;
  }
  if (marks_used_ == mark_count) {
    // Commands from before the oldest mark are late. The window follows the oldest mark, so that
    // the numbers of a host without commands for hours stay in the window.
    if (has_baseline_ && marks_[0].pnum - newest_ > command_window / 2) spend(marks_[0].pnum);
    for (int i = 1; i < mark_count; ++i) marks_[i - 1] = marks_[i];
    --marks_used_;
  }
  marks_[marks_used_++] = Mark{heartbeat.pnum, at_ms};
}

bool BoardLink::lose(std::uint32_t now_ms) {
  if (state_ != BoardLinkState::active) return false;
  state_ = BoardLinkState::lost;
  lost_ms_ = now_ms;
  send_now_ = true;
  return true;
}

bool BoardLink::poll(std::uint32_t now_ms) {
  return now_ms - fed_ms_ >= timing_.timeout_ms && lose(now_ms);
}

void BoardLink::leave(std::uint32_t now_ms) {
  left_[left_next_] = host_.sid;
  left_next_ = (left_next_ + 1) % left_memory;
  lose(now_ms);
}

bool BoardLink::first_heartbeat(HostId host, std::uint32_t& pnum) const {
  pnum = first_heartbeat_;
  return is_session_of(host) && has_heartbeat_pnum_;
}

bool BoardLink::in_window(std::uint32_t pnum) const {
  return !has_baseline_ || (newer(pnum, newest_) && pnum - newest_ <= command_window);
}

bool BoardLink::is_next(std::uint32_t pnum) const {
  return (has_baseline_ && pnum - newest_ <= memory) ||
         (has_heartbeat_pnum_ && pnum - newest_heartbeat_ <= memory);
}

Refusal BoardLink::admit(HostId host, std::uint32_t pnum, std::uint32_t now_ms) const {
  const bool ours = is_session_of(host);
  // A spent number always gets the same answer, in every link state.
  if (ours && has_baseline_ && !newer(pnum, newest_)) {
    const Refusal code = code_of_spent(pnum);
    if (code != Refusal::stale) return code;
  }
  if (state_ != BoardLinkState::active) return Refusal::safe;
  if (!ours) return Refusal::busy;
  if (!in_window(pnum)) return Refusal::stale;
  for (int i = 0; i < marks_used_; ++i) {
    if (now_ms - marks_[i].at_ms > late_limit_ms && newer(marks_[i].pnum, pnum)) {
      return Refusal::stale;
    }
  }
  return Refusal::none;
}

Refusal BoardLink::code_of_spent(std::uint32_t pnum) const {
  const std::uint32_t behind = newest_ - pnum;
  if (behind < memory && ((executed_bits_ >> behind) & 1U) != 0) return Refusal::duplicate;
  for (int i = 0; i < refused_used_; ++i) {
    if (refused_[i] == pnum) return refused_codes_[i];
  }
  return Refusal::stale;
}

void BoardLink::spend(std::uint32_t pnum) {
  if (has_baseline_ && !newer(pnum, newest_)) return;
  const std::uint32_t ahead = has_baseline_ ? pnum - newest_ : memory;
  executed_bits_ = ahead < memory ? executed_bits_ << ahead : 0;
  newest_ = pnum;
  has_baseline_ = true;
}

void BoardLink::refused(HostId host, std::uint32_t pnum, Refusal code) {
  if (!is_session_of(host) || !in_window(pnum)) return;
  spend(pnum);
  refused_[refused_next_] = pnum;
  refused_codes_[refused_next_] = code;
  refused_next_ = (refused_next_ + 1) % refused_memory;
  if (refused_used_ < refused_memory) ++refused_used_;
}

void BoardLink::executed(std::uint32_t pnum) {
  spend(pnum);
  const std::uint32_t behind = newest_ - pnum;
  if (behind < memory) executed_bits_ |= std::uint64_t{1} << behind;
  if (behind == 0) last_executed_ = pnum;
}

// A lost heartbeat must not make the echoes of a host with a session id stale.
bool BoardLink::lacks_echo() const {
  return has_owner() && host_.sid != no_session && newer(last_sent_ms_, newest_echo_ms_);
}

bool BoardLink::heartbeat_due(std::uint32_t now_ms) const {
  if (send_now_ || !any_sent_) return true;
  const std::uint32_t since = now_ms - last_sent_ms_;
  return since >= timing_.heartbeat_ms || (lacks_echo() && since >= echo_retry_ms);
}

void BoardLink::heartbeat_sent(std::uint32_t t_ms) {
  any_sent_ = true;
  send_now_ = false;
  last_sent_ms_ = t_ms;
  // A session, or the time without a session, may last for months.
  keep_near(lost_ms_, t_ms);
  keep_near(newest_echo_ms_, t_ms);
}

std::uint32_t BoardLink::answer_time(std::uint32_t t_ms) const {
  const std::uint32_t newest = sent_[(sent_next_ + sent_count - 1) % sent_count];
  const bool recent = sent_used_ != 0 && t_ms - newest < answer_spacing_ms;
  return recent && (state_ != BoardLinkState::lost || reached(newest, lost_ms_)) ? newest : t_ms;
}

void BoardLink::shown(std::uint32_t t_ms) {
  if (is_echo(t_ms)) return;
  sent_[sent_next_] = t_ms;
  sent_next_ = (sent_next_ + 1) % sent_count;
  if (sent_used_ < sent_count) ++sent_used_;
}

std::uint32_t BoardLink::due_in(std::uint32_t now_ms) const {
  if (heartbeat_due(now_ms)) return 0;
  const std::uint32_t since = now_ms - last_sent_ms_;
  std::uint32_t due = timing_.heartbeat_ms - since;
  if (lacks_echo() && echo_retry_ms - since < due) due = echo_retry_ms - since;
  if (state_ == BoardLinkState::active) {
    const std::uint32_t silent = now_ms - fed_ms_;
    const std::uint32_t left = silent < timing_.timeout_ms ? timing_.timeout_ms - silent : 0;
    if (left < due) due = left;
  }
  return due;
}

}  // namespace r4
