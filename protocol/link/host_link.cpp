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

// Answers a T at once only the first time: a board that cannot use the answer repeats the T.
void HostLink::on_heartbeat(std::uint32_t t_ms) {
  if (t_ms == echo_) return;
  echo_ = t_ms;
  answer_now_ = true;
}

void HostLink::on_reason(SafeReason reason, std::uint32_t now_ms) {
  on_heard(now_ms);
  booting_ = false;
  reason_ = reason;
  state_ = reason == SafeReason::none ? HostLinkState::active : HostLinkState::safe;
}

void HostLink::on_heard(std::uint32_t now_ms) {
  heard_ = true;
  heard_ms_ = now_ms;
}

void HostLink::on_booting(SafeReason reason, std::uint32_t now_ms) {
  on_heard(now_ms);
  booting_ = true;
  state_ = HostLinkState::connecting;
  reason_ = reason;
  answer_now_ = true;
  forget_boot();
}

void HostLink::on_restart() {
  ++restarts_;
  if (!booting_) end_session();
  booting_ = false;
  forget_boot();
}

void HostLink::forget_boot() {
  echo_ = 0;
  echoed_ = false;
}

void HostLink::begin_anew() {
  ++restarts_;
  end_session();
  forget_boot();
  heard_ = booting_ = false;
  answer_now_ = true;
  if (state_ != HostLinkState::connecting) state_ = HostLinkState::lost;
}

// The board may continue this session, whose setpoints are outdated if the host's clock stood
// still. In a paused virtual machine only the board's clock shows the pause.
void HostLink::end_session() {
  session_ = no_session;
  first_pnum_ = next_pnum_;
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
  echoed_before_ = echoed_;
  if (echo_ != 0) echoed_ = true;
}

void HostLink::heartbeat_not_sent(std::uint32_t now_ms) {
  sent_ms_ = now_ms - timing_.heartbeat_ms + retry_ms;
  any_sent_ = true;
  answer_now_ = false;
  echoed_ = echoed_before_;
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
