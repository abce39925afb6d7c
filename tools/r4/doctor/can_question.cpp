// SPDX-License-Identifier: GPL-3.0-or-later
#include "can_question.hpp"

#include <array>
#include <system_error>

#include "r4link/datagram.hpp"
#include "r4link/discovery/async_carriers.hpp"
#include "r4link/messages/datagram_writer.hpp"
#include "r4link/messages/message.hpp"

namespace r4::tool {
namespace {

constexpr std::chrono::milliseconds ask_again{300};   // longer than a timely answer takes
constexpr std::chrono::milliseconds look_at_bus{20};  // while another host uses the bus

}  // namespace

CanQuestion::CanQuestion(asio::io_context& io, std::string_view url)
    : carrier_(make_own_carrier(io, url)), timer_(io) {
  carrier_->open(*this);
  ask();
}

void CanQuestion::ask() {
  if (const TransportTrouble now = carrier_->trouble(); now != TransportTrouble::none)
    trouble_ = now;
  if (answer_us_ > 0) return;
  std::array<char, 64> buffer;
  const Text question =
      DatagramWriter(buffer.data(), buffer.size()).field("Q").value("ID").finish();
  const bool sent =
      carrier_->send({question.data(), question.size()}, Priority::normal) == SendResult::sent;
  if (sent) {
    asked_ = Clock::now();
    if (!first_asked_) first_asked_ = asked_;
  }
  timer_.after(sent ? ask_again : look_at_bus, [this] { ask(); });
}

void CanQuestion::hear(const Datagram& datagram) {
  Identity identity;
  if (!asked_ || !read_identity(datagram, identity)) return;
  answer_us_ = std::chrono::duration<double, std::micro>(Clock::now() - *asked_).count();
  asked_.reset();
}

double CanQuestion::asked_since_s() const {
  if (!first_asked_) return 0;
  return std::chrono::duration<double>(Clock::now() - *first_asked_).count();
}

}  // namespace r4::tool
