// SPDX-License-Identifier: GPL-3.0-or-later
#include "can_question.hpp"

#include "transports/can/can_carrier.hpp"
#include "transports/identity_answer.hpp"

namespace r4::tool {
namespace {

constexpr std::chrono::milliseconds ask_again{300};   // longer than an answer that is in time
constexpr std::chrono::milliseconds look_at_bus{20};  // while the bus is not ours

}  // namespace

CanQuestion::CanQuestion(asio::io_context& io, const Url& url)
    : carrier_(make_can_carrier(io, url, Role::host)), timer_(io) {
  carrier_->open(*this);
  ask();
}

void CanQuestion::ask() {
  if (const TransportTrouble now = carrier_->trouble(); now != TransportTrouble::none)
    trouble_ = now;
  if (answer_us_ > 0) return;
  const bool sent = carrier_->send(identity_question(), Priority::normal) == SendResult::sent;
  if (sent) {
    asked_ = Clock::now();
    if (!first_asked_) first_asked_ = asked_;
  }
  timer_.after(sent ? ask_again : look_at_bus, [this] { ask(); });
}

void CanQuestion::hear(Text datagram) {
  if (!asked_ || !read_identity_answer(datagram)) return;
  answer_us_ = std::chrono::duration<double, std::micro>(Clock::now() - *asked_).count();
  asked_.reset();
}

double CanQuestion::asked_since_s() const {
  if (!first_asked_) return 0;
  return std::chrono::duration<double>(Clock::now() - *first_asked_).count();
}

}  // namespace r4::tool
