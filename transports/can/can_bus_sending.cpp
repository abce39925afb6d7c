// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <asio/post.hpp>
#include <cerrno>

#include "can_bus.hpp"
#include "r4link/can/can_interface.hpp"

namespace r4 {
namespace {

constexpr std::chrono::milliseconds retry_interval{1};

}  // namespace

// On a slow bus, flow control that waited for a whole datagram of telemetry would be late.
void CanBus::send_urgent(std::uint32_t now_us) {
  CanFrame frame;
  for (const Membership& each : members_) {
    while (each.member != nullptr && each.member->offer_urgent(now_us, frame) &&
           medium_->send_first(frame) == CanMedium::Outcome::done) {
      each.member->frame_sent(now_us);
    }
  }
}

// Called only when no frame is left, so that members offer their newest datagrams.
bool CanBus::refill(std::uint32_t now_us) {
  std::size_t quiet = 0;
  while (out_count_ < ahead && quiet < members_.size()) {
    next_ %= members_.size();
    Member* const member = members_[next_].member;
    if (member != nullptr && member->offer(now_us, out_[out_count_])) {
      out_of_[out_count_++] = member;
      quiet = 0;
      member->frame_sent(now_us);
    } else {
      ++next_;
      ++quiet;
    }
  }
  return out_count_ != 0;
}

void CanBus::have_left(std::size_t count) {
  if (count != 0) progress_ = Clock::now();
  for (std::size_t i = 0; late_ && i < count; ++i) {
    if (out_of_[i] != nullptr) out_of_[i]->on_late_frame(out_[i], to_us(progress_));
  }
  const auto gone = static_cast<std::ptrdiff_t>(count);
  const auto end = static_cast<std::ptrdiff_t>(out_count_);
  std::move(out_.begin() + gone, out_.begin() + end, out_.begin());
  std::move(out_of_.begin() + gone, out_of_.begin() + end, out_of_.begin());
  out_count_ -= count;
  late_ = out_count_ != 0;
}

void CanBus::drop_queue() {
  out_count_ = 0;
  late_ = false;
}

void CanBus::send() {
  if (!up() || sending_) return;
  sending_ = true;
  CanMedium::Outcome outcome = CanMedium::Outcome::done;
  if (out_count_ == 0) progress_ = Clock::now();
  send_urgent(now_us());
  while (outcome == CanMedium::Outcome::done && (out_count_ != 0 || refill(now_us()))) {
    std::size_t sent = 0;
    outcome = medium_->send(out_.data(), out_count_, sent);
    const int error = errno;
    have_left(sent);
    if (outcome == CanMedium::Outcome::failed) {
      asio::post(io_, retrying_.handler([this, error] { go_down(medium_->problem(error), true); }));
    }
  }
  sending_ = false;
  clear_places();
  if (outcome == CanMedium::Outcome::done) {
    writable_.stop();
  } else if (outcome != CanMedium::Outcome::failed) {
    send_later(outcome);
  }
  for_each_member([](Member& member) { member.on_sent(); });
}

// The timer is needed because the system does not report room in the interface's queue.
void CanBus::send_later(CanMedium::Outcome outcome) {
  if (Clock::now() - progress_ > patience) {
    drop_queue();
    progress_ = Clock::now();
    for_each_member([](Member& member) { member.on_stuck(); });
  }
  retry_timer_.expires_after(retry_interval);
  retry_timer_.async_wait(retrying_.handler([this] { send(); }));
  if (outcome == CanMedium::Outcome::busy) writable_.start(medium_->number(), [this] { send(); });
}

}  // namespace r4
