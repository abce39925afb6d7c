// SPDX-License-Identifier: GPL-3.0-or-later
#include "board_link.hpp"

namespace r4 {

namespace {

constexpr bool at_or_after(std::uint32_t a, std::uint32_t b) {
  return static_cast<std::int32_t>(a - b) >= 0;
}

}  // namespace

// A T that the board gave one of its recent heartbeats?
bool BoardLink::sent_at(std::uint32_t t_ms) const {
  for (int i = 0; i < sent_used_; ++i) {
    if (sent_[i] == t_ms) return true;
  }
  return false;
}

// Is the T of this heartbeat a recent T of ours, an old one, or something else?
BoardLink::Freshness BoardLink::judge(const HostHeartbeat& heartbeat, bool echo_host,
                                      std::uint32_t now_ms) const {
  const bool board_time = heartbeat.has_time && heartbeat.t <= 0xffffffffU;
  const std::uint32_t t = static_cast<std::uint32_t>(heartbeat.t);
  const bool known = board_time && t != 0 && sent_at(t);
  const bool recent = at_or_after(now_ms, t) && now_ms - t <= timing_.timeout_ms;
  // What was sent before the link was lost says nothing of the host's being alive now.
  const bool this_episode = state_ != BoardLinkState::lost || at_or_after(t, lost_ms_);
  if (echo_host) return known && recent && this_episode ? Freshness::fresh : Freshness::stale;
  if (clock_ == Clock::own && has_session_ && heartbeat.from == owner_) return Freshness::no_echo;
  if (known) return recent ? Freshness::fresh : Freshness::stale;
  const bool echoes = clock_ == Clock::echo && has_session_ && heartbeat.from == owner_;
  return echoes ? Freshness::stale : Freshness::no_echo;
}

// Does the heartbeat go on where the session's numbers are?
bool BoardLink::continues(const HostHeartbeat& heartbeat) const {
  if (!has_session_ || heartbeat.from != owner_) return false;
  const bool echo_host = heartbeat.has_pnum && heartbeat.pnum >= echo_host_first_pnum;
  if (echo_host_ && !echo_host && !(heartbeat.has_pnum && heartbeat.pnum < command_window)) {
    return false;  // a declared host stays one until its numbers wrap
  }
  if (!heartbeat.has_pnum) return true;
  return !has_heartbeat_pnum_ || (newer(heartbeat.pnum, newest_heartbeat_) &&
                                  heartbeat.pnum - newest_heartbeat_ <= command_window);
}

HeartbeatEffect BoardLink::begin_session(const HostHeartbeat& heartbeat, bool armed,
                                         std::uint32_t now_ms) {
  has_session_ = true;
  owner_ = heartbeat.from;
  echo_host_ = heartbeat.has_pnum && heartbeat.pnum >= echo_host_first_pnum;
  armed_ = armed;
  clock_ = Clock::unknown;
  has_baseline_ = heartbeat.has_pnum;
  newest_ = heartbeat.pnum;
  executed_bits_ = 0;
  last_executed_ = 0;
  has_heartbeat_pnum_ = false;
  marks_used_ = 0;
  newest_echo_ms_ = now_ms - timing_.timeout_ms;
  state_ = BoardLinkState::active;
  send_now_ = true;
  feed(heartbeat, now_ms);
  return HeartbeatEffect::new_session;
}

void BoardLink::feed(const HostHeartbeat& heartbeat, std::uint32_t now_ms) {
  fed_ms_ = now_ms;
  const std::uint32_t t = static_cast<std::uint32_t>(heartbeat.t);
  const bool known = heartbeat.has_time && heartbeat.t <= 0xffffffffU && t != 0 && sent_at(t);
  if (known && (armed_ || echo_host_) && newer(t, newest_echo_ms_)) newest_echo_ms_ = t;
  if (!echo_host_ && clock_ == Clock::unknown && heartbeat.has_time && heartbeat.t != 0) {
    clock_ = known ? Clock::echo : Clock::own;
  }
  if (!heartbeat.has_pnum) return;
  has_heartbeat_pnum_ = true;
  newest_heartbeat_ = heartbeat.pnum;
  // Keep the marks apart by a share of the limit, the newest replacing itself until then.
  constexpr std::uint32_t spacing_ms = late_limit_ms / (mark_count - 1);
  if (marks_used_ != 0 && now_ms - marks_[marks_used_ - 1].at_ms < spacing_ms) return;
  if (marks_used_ == mark_count) {
    for (int i = 1; i < mark_count; ++i) marks_[i - 1] = marks_[i];
    --marks_used_;
  }
  marks_[marks_used_++] = Mark{heartbeat.pnum, now_ms};
}

HeartbeatEffect BoardLink::on_heartbeat(const HostHeartbeat& heartbeat, std::uint32_t now_ms) {
  const bool echo_host = heartbeat.has_pnum && heartbeat.pnum >= echo_host_first_pnum;
  const bool continuing = continues(heartbeat);
  const bool declared = echo_host || (continuing && echo_host_);
  const Freshness freshness = judge(heartbeat, declared, now_ms);

  switch (state_) {
    case BoardLinkState::connecting:
      // The first word of a host. An echo host's commands wait for its echo of a T of this boot.
      if (declared && heartbeat.t != 0) return HeartbeatEffect::stale;
      if (freshness == Freshness::stale && !declared) return HeartbeatEffect::stale;
      return begin_session(heartbeat, !declared, now_ms);

    case BoardLinkState::active:
      if (heartbeat.from != owner_) return HeartbeatEffect::busy;
      if (declared && !armed_ && continuing && freshness == Freshness::fresh) {
        armed_ = true;
        spend(heartbeat.pnum);
        feed(heartbeat, now_ms);
        return HeartbeatEffect::fed;
      }
      if (continuing) {
        if (freshness == Freshness::stale) return HeartbeatEffect::stale;
        feed(heartbeat, now_ms);
        return HeartbeatEffect::fed;
      }
      // The same place, other numbers: a restarted host, if its echo is newer than any before.
      if (declared && freshness == Freshness::fresh &&
          newer(static_cast<std::uint32_t>(heartbeat.t), newest_echo_ms_) &&
          (heartbeat.pnum - newest_heartbeat_) > command_window &&
          (newest_heartbeat_ - heartbeat.pnum) > command_window) {
        return begin_session(heartbeat, true, now_ms);
      }
      return HeartbeatEffect::stale;

    case BoardLinkState::lost:
      if (freshness == Freshness::stale) return HeartbeatEffect::stale;
      if (continuing && armed_) {
        state_ = BoardLinkState::active;
        send_now_ = true;
        if (heartbeat.has_pnum) spend(heartbeat.pnum);  // what was sent before the outage
        feed(heartbeat, now_ms);
        return HeartbeatEffect::resumed;
      }
      return begin_session(heartbeat, true, now_ms);
  }
  return HeartbeatEffect::stale;
}

Admission BoardLink::admit(Source from, std::uint32_t pnum, std::uint32_t now_ms,
                           Refusal& code) const {
  // Whatever the link is now: a number that was executed is answered so, and the host knows.
  const std::uint32_t behind = newest_ - pnum;
  const bool ours = has_session_ && from == owner_;
  if (ours && has_baseline_ && behind < memory && ((executed_bits_ >> behind) & 1U) != 0) {
    code = Refusal::duplicate;
    return Admission::refuse;
  }
  if (state_ != BoardLinkState::active) {
    code = Refusal::safe;
    return Admission::refuse;
  }
  if (!ours) {
    code = Refusal::busy;
    return Admission::refuse;
  }
  if (!armed_) return Admission::drop;
  if (has_baseline_ && (!newer(pnum, newest_) || pnum - newest_ > command_window)) {
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
  if (has_baseline_ && !newer(pnum, newest_)) return;
  const std::uint32_t ahead = has_baseline_ ? pnum - newest_ : memory;
  executed_bits_ = ahead < memory ? executed_bits_ << ahead : 0;
  newest_ = pnum;
  has_baseline_ = true;
}

void BoardLink::refused(Source from, std::uint32_t pnum) {
  const bool in_window = has_baseline_ && pnum - newest_ <= command_window;
  if (has_session_ && from == owner_ && in_window) spend(pnum);
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
  if (state_ == BoardLinkState::connecting) return;  // those carry T:0
  sent_[sent_next_] = t_ms;
  sent_next_ = (sent_next_ + 1) % sent_count;
  if (sent_used_ < sent_count) ++sent_used_;
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
