// SPDX-License-Identifier: GPL-3.0-or-later
#include "bridge_control.hpp"

namespace r4 {

bool BridgeControl::on_heartbeat(Peer from, Time now) {
  if (host_ != from) {
    if (host_ && !free(now)) return false;
    host_ = from;
    streamed_ = now;
  }
  heard_ = now;
  leaving_ = left_ = false;
  return true;
}

bool BridgeControl::free(Time now) const {
  return left_ || now - heard_ >= timeout_ || now - streamed_ >= unanswered;
}

}  // namespace r4
