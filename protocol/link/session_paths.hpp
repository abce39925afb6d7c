// SPDX-License-Identifier: GPL-3.0-or-later
// The paths of a session: from where its host is heard, and where the board's datagrams go
// (docs/protocol.md, "Paths").
//
//     unknown --a heartbeat of the session with a fresh echo--> path --silent for the timeout, port gone--> unknown
//
// A path proves itself by the echo: whoever sends it has received a heartbeat of the board, and knows the session's id.
// The last path does not leave by silence: then the link is lost.
//
// The host's packet numbers are counted here, too: lost over all paths, repeated on one and the same path.
// All times are the board's clock in ms, which wraps.
#pragma once

#include <cstdint>

#include "board_link.hpp"
#include "r4link/messages/packet_tracker.hpp"

namespace r4 {

class SessionPaths {
 public:
  static constexpr int most = 4;

  // A session begins by a heartbeat from there: that is its only path.
  void begin(Source at, std::uint32_t now_ms);
  // It goes on after an outage, likewise. The count of the host's numbers goes on, too.
  void resume(Source at, std::uint32_t now_ms);
  // A heartbeat of the session with a fresh echo came from there. True if that became a path by it.
  bool on_heartbeat(Source from, std::uint32_t now_ms);
  // True if a path left because it was silent for the timeout; ask again, for there may be another. The last one stays.
  bool take_silent(std::uint32_t timeout_ms, std::uint32_t now_ms, Source& left);
  // True if a path left because its port is gone; ask again, likewise.
  bool take_port(std::uint8_t port, Source& left);

  // Counts a number of the host's. True if another path has brought it before.
  bool count(Source from, std::uint32_t pnum);
  std::uint32_t lost() const { return numbers_.counters().lost; }
  std::uint32_t repeated() const { return repeated_; }

  bool has(Source at) const { return find(at) >= 0; }
  int size() const { return count_; }  // 0: before the first session, or all are gone
  Source operator[](int i) const { return paths_[i].at; }
  std::uint32_t joins() const { return joins_; }    // since boot, besides the first of each session
  std::uint32_t losses() const { return losses_; }  // since boot, of sessions that went on

 private:
  struct Path {
    Source at;
    std::uint32_t heard_ms = 0;
    std::uint64_t seen = 0;  // bit i: it has brought the number numbers_.newest() - i
  };

  int find(Source at) const;  // -1: it is no path
  bool leave(int index, Source& left);

  Path paths_[most];
  int count_ = 0;
  std::uint32_t joins_ = 0;
  std::uint32_t losses_ = 0;
  PacketTracker numbers_;
  std::uint32_t repeated_ = 0;
};

}  // namespace r4
