// SPDX-License-Identifier: GPL-3.0-or-later
// Lines on their way out of a serial port: never waits, and the newest state wins.
//
// Lines go through a ring, each whole or not at all. A state that finds no room waits outside of it,
// where a newer one replaces it; the last part of the ring is kept for heartbeats and answers. If
// nothing has left for `stale_ms` (the host does not read), the lines that have not begun are thrown
// away and none are taken but the newest state, so that a host which reads again hears the present.
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

  // A heartbeat or an answer. What finds no room is dropped.
  void put(Text datagram) {
    if (stalled_ || !put_line(datagram)) ++dropped_;
  }
  // A state. Later ones may replace it.
  void put_state(Text datagram) {
    if (waiting_size_ != 0) ++dropped_;
    waiting_size_ = 0;
    if (put_state_line(datagram)) return;
    std::memcpy(waiting_, datagram.data(), datagram.size());
    waiting_size_ = datagram.size();
  }
  // Lets time pass: what waits goes into the ring if there is room. With the taker's interrupt off.
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

  // Forgets all that waits: whoever was at the other end has gone. While the taker does not run.
  void clear() {
    if (!ring_.empty() || waiting_size_ != 0) ++dropped_;
    ring_.cut(0);
    waiting_size_ = 0;
    stalled_ = false;
  }

  // The next byte for the port, from its interrupt or with that off. False: there is none.
  bool take(char& byte) {
    if (!ring_.take(byte)) return false;
    taken_ = taken_ + 1;
    return true;
  }

  bool empty() const { return ring_.empty(); }
  std::uint32_t dropped() const { return dropped_; }  // lines

 private:
  bool put_line(Text datagram) {
    const std::uint32_t size = static_cast<std::uint32_t>(datagram.size() + line_end.size());
    if (ring_.room() < size) return false;
    // The ring takes either whole: there is room for both.
    ring_.put(datagram.data(), static_cast<std::uint32_t>(datagram.size()));
    ring_.put(line_end.data(), static_cast<std::uint32_t>(line_end.size()));
    return true;
  }
  bool put_state_line(Text datagram) {
    return !stalled_ && ring_.room() >= datagram.size() + line_end.size() + kept_for_answers &&
           put_line(datagram);
  }
  // Throws away what has not begun: all behind the end of the first line.
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
  volatile std::uint32_t taken_ = 0;  // bytes, ever
  std::uint32_t taken_before_ = 0;
  std::uint32_t progress_ms_ = 0;
  bool stalled_ = false;
  std::uint32_t dropped_ = 0;
};

}  // namespace firmware
}  // namespace r4
