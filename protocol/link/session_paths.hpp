// SPDX-License-Identifier: GPL-3.0-or-later
// The paths between the board and a session's host (docs/reference/protocol.md "Paths").
//     unknown -- heartbeat of the session with a fresh echo --> path
//     path    -- silent for the timeout, or its port down ----> unknown
// The echo proves a path: its sender has received a heartbeat of the board, and has the session's
// id. If the last path is silent, it is not removed: the link is lost. Counts the host's packet
// numbers: lost over all paths, repeated on the same path. Times are the board's ms, and wrap.
#pragma once

#include <cstdint>

#include "board_link.hpp"
#include "r4link/messages/packet_tracker.hpp"

namespace r4 {

class SessionPaths {
 public:
  static constexpr int most = 4;

  // Makes this the only path: for a new session, or after an outage (the host's numbers continue).
  void begin(Source at, std::uint32_t now_ms);
  void resume(Source at, std::uint32_t now_ms);
  // A heartbeat of the session with a fresh echo came from `from`. True if the path is new.
  bool on_heartbeat(Source from, std::uint32_t now_ms);
  // True if a silent path was removed: `left`. Never removes the last path. Call until false.
  bool take_silent(std::uint32_t timeout_ms, std::uint32_t now_ms, Source& left);
  // True if a path on `port` was removed: `left`. Call until false.
  bool take_port(std::uint8_t port, Source& left);

  // Counts a number of the host. True if another path has delivered the number before, or may have.
  bool count(Source from, std::uint32_t pnum);
  std::uint32_t lost() const { return numbers_.counters().lost; }
  std::uint32_t repeated() const { return repeated_; }

  bool has(Source at) const { return find(at) >= 0; }
  int size() const { return count_; }  // 0 before the first session, or if all paths are lost
  Source operator[](int i) const { return paths_[i].at; }
  std::uint32_t joins() const { return joins_; }    // since boot, without the first of each session
  std::uint32_t losses() const { return losses_; }  // since boot

 private:
  struct Path {
    Source at;
    std::uint32_t heard_ms = 0;
    std::uint64_t seen = 0;  // bit i: the path has delivered the number numbers_.newest() - i
  };

  int find(Source at) const;
  bool leave(int index, Source& left);

  Path paths_[most];
  int count_ = 0;
  std::uint32_t joins_ = 0;
  std::uint32_t losses_ = 0;
  PacketTracker numbers_;
  std::uint32_t repeated_ = 0;
};

}  // namespace r4
