// SPDX-License-Identifier: GPL-3.0-or-later
#include "bridge_control.hpp"

#include <algorithm>

namespace r4 {

bool BridgeControl::on_heartbeat(Peer from, Time now) {
  if (host_ != from) {
    const bool back = stepped_back(from);
    if (is_taken(now) || (back && now - asked_ < courtesy)) {
      if (!back) asked_ = now;
      return false;
    }
    if (host_ && !streams_ && !stepped_back(*host_)) {
      stepped_back_[next_stepped_back_++ % remembered] = host_;
    }
    host_ = from;
    streamed_ = now;
    streams_ = false;
    next_number_ = 0;
  }
  heard_ = now;
  leaving_ = left_ = false;
  return true;
}

bool BridgeControl::free(Time now) const {
  return left_ || now - heard_ >= timeout_ || now - streamed_ >= (streams_ ? unanswered : untaken);
}

bool BridgeControl::has_sent(std::uint32_t pnum) const {
  const auto end =
      numbers_.begin() + static_cast<std::ptrdiff_t>(std::min(next_number_, numbers_.size()));
  return std::find(numbers_.begin(), end, pnum) != end;
}

bool BridgeControl::stepped_back(Peer host) const {
  return std::find(stepped_back_.begin(), stepped_back_.end(), host) != stepped_back_.end();
}

}  // namespace r4
