// SPDX-License-Identifier: GPL-3.0-or-later
#include "application.hpp"

namespace r4 {
namespace firmware {

void Application::look_at_time(std::uint32_t now_ms) {
  bool lost = link_.poll(now_ms);
  if (guard_.tripped()) {
    const SafeReason cause = guard_.take();
    if (cause == SafeReason::watchdog) fail(cause, now_ms);
    if (cause == SafeReason::stop && !safety_.has(cause)) stop_without_number(now_ms);
    if (cause == SafeReason::link) lost = link_.lose(now_ms) || lost;
  }
  look_at_stops(now_ms);
  if (lost) enter(SafeReason::link, now_ms);
}

// A stop that an interrupt has received applies at once. Its datagram shows later whether the stop
// is a repetition. If a port had no room for the datagram, the stop counts as a new cause.
void Application::look_at_stops(std::uint32_t now_ms) {
  const std::uint32_t heard = guard_.stops_heard();
  if (heard != stops_heard_) {
    unread_stops_ += heard - stops_heard_;
    stops_heard_ = heard;
    unread_ms_ = now_ms;
    if (!safety_.has(SafeReason::stop)) stop_without_number(now_ms);
  } else if (unread_stops_ != 0 && now_ms - unread_ms_ >= catch_up_ms) {
    unread_stops_ = 0;
    fail(SafeReason::stop, now_ms);
  }
}

void Application::stop_without_number(std::uint32_t now_ms) {
  fail(SafeReason::stop, now_ms);
  has_stop_number_ = false;
}

void Application::enter(SafeReason cause, std::uint32_t now_ms) {
  drop_device_writes();
  if (!safety_.enter(cause)) return;
  if (cause == SafeReason::link) {
    hold_paths();
    tell_ports();
  } else {
    setpoints_.outputs = Outputs();
    caused_ms_ = now_ms;
  }
  link_.send_soon();
  update_outputs(now_ms);
  authentication_.renew();
  report_state(now_ms);
}

// An E:CLEAR without a number must arrive at least the timeout after the cause, because older
// datagrams are not delayed for longer. Without a latched cause, every E:CLEAR is accepted.
Refusal Application::judge_clear(const Command& command, std::uint32_t waited_ms,
                                 std::uint32_t now_ms) const {
  if (unread_stops_ != 0) return Refusal::stale;  // the numbers of these stops are not reported yet
  if (command.value != Command::unnamed_cause) {
    const bool named = command.value == safety_.newest() || !safety_.latched();
    return named ? Refusal::none : Refusal::stale;
  }
  const bool settled = now_ms - caused_ms_ >= setpoints_.settings.timeout_ms + waited_ms;
  return settled || !safety_.latched() ? Refusal::none : Refusal::stale;
}

void Application::clear() {
  if (safety_.reason() != SafeReason::fault || hal_.clear_fault()) safety_.clear();
}

bool Application::any_threshold() const {
  for (const std::uint16_t cm : setpoints_.proximity_cm) {
    if (cm != 0) return true;
  }
  return false;
}

bool Application::obstacle() const {
  const int margin = safety_.has(SafeReason::proximity) ? proximity_hysteresis_cm : 0;
  for (int i = 0; i < ultrasonic_channels; ++i) {
    const int threshold = setpoints_.proximity_cm[i];
    if (threshold == 0) continue;
    if ((inputs_.ultrasonic_blind >> i & 1) != 0) return true;
    const int distance = inputs_.ultrasonic_cm[i];
    if (distance != 0 && distance < threshold + margin) return true;
  }
  return false;
}

void Application::check_interlocks(std::uint32_t now_ms) {
  hal_.sample(inputs_);
  if (inputs_.fault.any()) enter(SafeReason::fault, now_ms);
  if (!inputs_.handle_held()) {
    enter(SafeReason::handle, now_ms);
  } else {
    safety_.leave(SafeReason::handle);
  }
  if (obstacle()) {
    obstacle_ms_ = now_ms;
    enter(SafeReason::proximity, now_ms);
  } else if (!any_threshold() || now_ms - obstacle_ms_ >= proximity_clear_ms) {
    safety_.leave(SafeReason::proximity);
  }
}

void Application::expect_host() {
  if (outputs_live_) {
    guard_.arm(link_.deadline_ms());
  } else {
    guard_.disarm();
  }
}

void Application::update_outputs(std::uint32_t now_ms) {
  static const Outputs off;
  const bool live = state() == BoardState::active;
  const Outputs& wanted = live ? setpoints_.outputs : off;
  const bool changed = wanted != outputs_ || rezeroed_;
  rezeroed_ = false;
  if (!changed && live == outputs_live_) return;
  outputs_ = wanted;
  if (live != outputs_live_) {
    outputs_live_ = live;
    expect_host();
  }
  if (live && !guard_.tripped()) {
    hal_.apply(outputs_);
    if (guard_.tripped()) hal_.make_safe();  // the guard may have tripped just before
  } else {
    hal_.make_safe();
  }
  if (changed && observer_ != nullptr) observer_->on_outputs(now_ms, outputs_);
}

void Application::report_state(std::uint32_t now_ms) {
  const BoardState state_now = state();
  const SafeReason reason_now = safety_.reason();
  if (state_now == reported_state_ && reason_now == reported_reason_) return;
  reported_state_ = state_now;
  reported_reason_ = reason_now;
  if (observer_ != nullptr) observer_->on_state(now_ms, state_now, reason_now);
}

}  // namespace firmware
}  // namespace r4
