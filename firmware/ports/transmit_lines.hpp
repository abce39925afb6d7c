// SPDX-License-Identifier: GPL-3.0-or-later
// The send queue of a serial port: it never waits, and the newest state replaces older states. Each
// line enters the ring whole or not at all. A state without room waits outside the ring, where a
// newer state replaces it. The last part of the ring is for heartbeats and answers. If no byte
// leaves for `stale_ms`, lines not begun are dropped and only the newest state is kept.
#pragma once

#include <cstdint>
#include <cstring>

#include "../../transports/framing/line_framing.hpp"
#include "byte_ring.hpp"
#include "r4link/datagram.hpp"

namespace r4 {
namespace firmware {

class TransmitLines {
 public:
  static constexpr std::uint32_t capacity = 2048;
  static constexpr std::uint32_t kept_for_answers = 512;
  static constexpr std::uint32_t stale_ms = 100;

  void put(Text datagram) {
    if (stalled_ || !put_line(datagram)) ++dropped_;
  }
  void put_state(Text datagram) {
    if (waiting_size_ != 0) ++dropped_;
    waiting_size_ = 0;
    if (put_state_line(datagram)) return;
    std::memcpy(waiting_, datagram.data(), datagram.size());
    waiting_size_ = datagram.size();
  }
  // If there is room, moves the waiting state into the ring. Call with the taker's interrupt off.
  void poll(std::uint32_t now_ms) {
    if (ring_.size() == 0 || taken_ != taken_before_) {
      taken_before_ = taken_;
      progress_ms_ = now_ms;
      stalled_ = false;
    } else if (!stalled_ && now_ms - progress_ms_ >= stale_ms) {
      stalled_ = true;
      cut();
    }
    if (waiting_size_ != 0 && put_state_line(Text(waiting_, waiting_size_))) waiting_size_ = 0;
  }

  // Drops all lines, because the host has disconnected. Call only while the taker does not run.
  void clear() {
    if (!ring_.empty() || waiting_size_ != 0) ++dropped_;
    ring_.cut(0);
    waiting_size_ = 0;
    stalled_ = false;
  }

  // Next byte for the port, in its interrupt or with the interrupt off. False if there is none.
  bool take(char& byte) {
    if (!ring_.take(byte)) return false;
    taken_ = taken_ + 1;
    return true;
  }

  bool empty() const { return ring_.empty(); }
  std::uint32_t dropped() const { return dropped_; }

 private:
  bool put_line(Text datagram) {
    const std::uint32_t size = static_cast<std::uint32_t>(datagram.size() + line_end.size());
    if (ring_.room() < size) return false;
    ring_.put(datagram.data(), static_cast<std::uint32_t>(datagram.size()));
    ring_.put(line_end.data(), static_cast<std::uint32_t>(line_end.size()));
    return true;
  }
  bool put_state_line(Text datagram) {
    return !stalled_ && ring_.room() >= datagram.size() + line_end.size() + kept_for_answers &&
           put_line(datagram);
  }
  // Drops all lines after the first line, which has begun.
  void cut() {
    std::uint32_t size = 0;
    while (size < ring_.size() && ring_.peek(size) != line_end[line_end.size() - 1]) ++size;
    if (size + 1 >= ring_.size()) return;
    ring_.cut(size + 1);
    ++dropped_;
  }

  ByteRing<capacity> ring_;
  char waiting_[max_datagram];
  std::size_t waiting_size_ = 0;
  volatile std::uint32_t taken_ = 0;  // bytes taken so far; wraps
  std::uint32_t taken_before_ = 0;
  std::uint32_t progress_ms_ = 0;
  bool stalled_ = false;
  std::uint32_t dropped_ = 0;
};

}  // namespace firmware
}  // namespace r4
