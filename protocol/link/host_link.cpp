// SPDX-License-Identifier: GPL-3.0-or-later
#include "host_link.hpp"

namespace r4 {

const char* to_text(HostLinkState state) {
  switch (state) {
    case HostLinkState::connecting:
      return "connecting";
    case HostLinkState::active:
      return "active";
    case HostLinkState::safe:
      return "safe";
    case HostLinkState::lost:
      return "lost";
  }
  return "unknown";
}

Arrival HostLink::on_datagram(std::uint32_t pnum, std::uint32_t t_ms, bool heartbeat,
                              SafeReason reason, std::uint32_t now_ms) {
  if (heartbeat && pnum == 0 && t_ms == 0) {
    if (tracker_.started()) tracker_.restart();
    on_booting(reason, now_ms);
    return Arrival::first;
  }
  notice_boot(t_ms, now_ms);
  const Arrival arrival = tracker_.on(pnum);
  if (!is_current(arrival)) return arrival;
  // Each T is answered at once only the first time: a board that cannot use the answer sends that T again.
  if (heartbeat && t_ms != echo_) {
    echo_ = t_ms;
    answer_now_ = true;
  }
  reason_ = reason;
  state_ = reason == SafeReason::none ? HostLinkState::active : HostLinkState::safe;
  return arrival;
}

// It knows nothing of us.
void HostLink::on_booting(SafeReason reason, std::uint32_t now_ms) {
  heard_ms_ = now_ms;
  booting_ = true;
  state_ = HostLinkState::connecting;
  reason_ = reason;
  answer_now_ = true;
  forget_boot();
}

void HostLink::forget_boot() {
  echo_ = 0;
  echoed_ = false;
  any_newest_ = false;
}

bool HostLink::on_newest(std::uint32_t t_ms, bool heartbeat, SafeReason reason,
                         std::uint32_t now_ms) {
  heard_ms_ = now_ms;
  if (heartbeat && (echo_ == 0 || newer(t_ms, echo_))) {
    echo_ = t_ms;
    answer_now_ = true;
  }
  if (any_newest_ && newer(newest_ms_, t_ms)) return false;
  any_newest_ = true;
  newest_ms_ = t_ms;
  on_clock(t_ms, false, now_ms);
  reason_ = reason;
  state_ = reason == SafeReason::none ? HostLinkState::active : HostLinkState::safe;
  return true;
}

void HostLink::on_clock(std::uint32_t t_ms, bool restarted, std::uint32_t now_ms) {
  if (restarted) {
    ++restarts_;
    if (!booting_) end_session();
    forget_boot();
  }
  booting_ = false;
  board_clock_known_ = true;
  board_ms_ = t_ms;
  clock_ms_ = heard_ms_ = now_ms;
}

Arrival HostLink::on_answer(std::uint32_t pnum, std::uint32_t t_ms, std::uint32_t now_ms) {
  notice_boot(t_ms, now_ms);
  return tracker_.on(pnum);
}

// Each boot has a clock of its own: a T that does not fit the last one is of a board that has begun
// again, even if its first heartbeats were lost.
void HostLink::notice_boot(std::uint32_t t_ms, std::uint32_t now_ms) {
  const std::int32_t tolerance = booting_ ? booting_tolerance_ms : boot_tolerance_ms;
  const bool restarted = !is_of_this_boot(t_ms, now_ms, now_ms, tolerance);
  if (restarted && tracker_.started()) tracker_.restart();
  on_clock(t_ms, restarted, now_ms);
}

void HostLink::begin_anew() {
  ++restarts_;
  if (tracker_.started()) tracker_.restart();
  end_session();
  forget_boot();
  board_clock_known_ = booting_ = false;
  answer_now_ = true;
  if (state_ != HostLinkState::connecting) state_ = HostLinkState::lost;
}

// The board may still hold our session with its setpoints, which nobody wants any more if our clock stood
// still. In a virtual machine that was paused, no clock of ours shows that: only the board's does.
void HostLink::end_session() {
  session_ = no_session;
  first_pnum_ = next_pnum_;
}

bool HostLink::is_of_this_boot(std::uint32_t t_ms, std::uint32_t since_ms, std::uint32_t now_ms,
                               std::int32_t tolerance_ms) const {
  if (!board_clock_known_) return true;
  const std::uint32_t begin = board_ms_ + (since_ms - clock_ms_);
  const std::uint32_t end = board_ms_ + (now_ms - clock_ms_);
  return static_cast<std::int32_t>(t_ms - begin) >= -tolerance_ms &&
         static_cast<std::int32_t>(t_ms - end) <= tolerance_ms;
}

void HostLink::on_transport(bool up) {
  if (up) {
    answer_now_ = true;
  } else if (state_ != HostLinkState::connecting) {
    state_ = HostLinkState::lost;
  }
}

bool HostLink::poll(std::uint32_t now_ms) {
  hung_ = watchdog_expired(now_ms);
  if (board_clock_known_ && now_ms - heard_ms_ > long_ago) begin_anew();
  if (state_ != HostLinkState::active && state_ != HostLinkState::safe) return false;
  if (now_ms - heard_ms_ < timing_.timeout_ms) return false;
  state_ = HostLinkState::lost;
  return true;
}

bool HostLink::heartbeat_due(std::uint32_t now_ms) const {
  if (gated(now_ms)) return false;
  return answer_now_ || !any_sent_ || now_ms - sent_ms_ >= timing_.heartbeat_ms;
}

void HostLink::heartbeat_sent(std::uint32_t now_ms) {
  sent_ms_ = now_ms;
  any_sent_ = true;
  answer_now_ = false;
  if (echo_ != 0) echoed_ = true;
}

void HostLink::heartbeat_not_sent(std::uint32_t now_ms) {
  sent_ms_ = now_ms - timing_.heartbeat_ms + retry_ms;
  any_sent_ = true;
  answer_now_ = false;
}

void HostLink::watchdog(std::uint32_t period_ms, std::uint32_t now_ms) {
  watchdog_ms_ = period_ms;
  feed(now_ms);
}

void HostLink::feed(std::uint32_t now_ms) {
  fed_ms_ = now_ms;
  hung_ = false;
}

std::uint32_t HostLink::due_in(std::uint32_t now_ms) const {
  if (heartbeat_due(now_ms)) return 0;
  std::uint32_t due = timing_.heartbeat_ms;
  if (!gated(now_ms)) due = timing_.heartbeat_ms - (now_ms - sent_ms_);
  if (state_ == HostLinkState::active || state_ == HostLinkState::safe) {
    const std::uint32_t silent = now_ms - heard_ms_;
    const std::uint32_t left = silent < timing_.timeout_ms ? timing_.timeout_ms - silent : 0;
    if (left < due) due = left;
  }
  return due;
}

}  // namespace r4
