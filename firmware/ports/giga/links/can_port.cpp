// SPDX-License-Identifier: GPL-3.0-or-later
#include "can_port.hpp"

#include <cstring>

namespace r4 {
namespace giga {

void CanPort::send(Text datagram, Priority priority, std::uint32_t) {
  if (!controller_.on_bus() || datagram.empty()) {
    ++dropped_;
    return;
  }
  if (priority == Priority::state) {
    if (state_size_ != 0) ++dropped_;
    std::memcpy(state_, datagram.data(), datagram.size());
    state_size_ = datagram.size();
  } else {
    const bool reply = node_.lane_of(datagram) == CanLane::dialogue;
    if (!(reply ? replies_ : heartbeats_).put(DatagramNote(), datagram)) ++dropped_;
  }
  pump();
}

bool CanPort::begin_next(CanLane lane, DatagramRing<queue_bytes>& queue) {
  if (!node_.idle(lane)) return false;
  DatagramNote note;
  char buffer[max_datagram];
  Text datagram;
  return queue.take(note, buffer, datagram) && node_.begin(datagram, clock_());
}

void CanPort::pump() {
  CanFrame frame;
  for (;;) {
    begin_next(CanLane::dialogue, replies_);
    if (!begin_next(CanLane::telemetry, heartbeats_) && state_size_ != 0 &&
        node_.idle(CanLane::telemetry)) {
      node_.begin(Text(state_, state_size_), clock_());
      state_size_ = 0;
    }
    const std::uint32_t now_us = clock_();
    const bool urgent = node_.offer_urgent(now_us, frame);
    if (!urgent && !node_.offer(now_us, frame)) return;
    const bool accepted = (urgent && controller_.send_urgent(frame)) || controller_.send(frame);
    if (!accepted) return;
    node_.frame_sent(now_us);
  }
}

void CanPort::forget() {
  node_.cancel();
  DatagramNote note;
  char buffer[max_datagram];
  Text datagram;
  while (replies_.take(note, buffer, datagram) || heartbeats_.take(note, buffer, datagram)) {
    ++dropped_;
  }
  if (state_size_ != 0) ++dropped_;
  state_size_ = 0;
}

}  // namespace giga
}  // namespace r4
