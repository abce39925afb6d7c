// SPDX-License-Identifier: GPL-3.0-or-later
// What of all that the paths of a session bring is new, and what is lost (paths.hpp). Each path has the board's packet
// numbers of its own; so across paths T tells what is newer, and what is a copy.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "../../protocol/link/packet_tracker.hpp"
#include "../../protocol/messages/message.hpp"
#include "../../protocol/messages/state_fields.hpp"

namespace r4 {

class PathNews {
 public:
  explicit PathNews(std::size_t paths) : paths_(paths) {}

  // --- numbers: of each datagram that is let through, before it is asked whether it is new

  void on_number(std::size_t index, std::uint32_t pnum);
  // Of an answer, which is always new. Those that come before the first other datagram do not count.
  void on_answer(std::size_t index, std::uint32_t pnum);
  // Other numbers follow.
  void restart(std::size_t index);

  // --- is it new? Each of them counts it.

  // Is the heartbeat no copy of what another path has brought, and not older?
  bool take_heartbeat(std::size_t path, std::uint32_t t_ms);
  // Is a state of the newest T of all states? What is older never replaces it.
  bool is_newest_state(std::size_t path, std::uint32_t t_ms);
  // Is it no copy? The state of a T may come in parts: then each part brings fields that those before had not.
  bool take_state(std::size_t path, std::uint32_t t_ms, FieldSet present);
  // Is nothing newer known of the board? Then it is the newest.
  bool is_newest(std::uint32_t t_ms);
  // Each path may bring an answer to its copy of a command. True of those that say nothing new.
  bool is_copy(const Nack& nack);

  // The board has begun again, by another clock.
  void forget() { newest_ = {}; }
  // It says that it is booting: whatever it sends then is new.
  void on_connecting() { newest_.any = newest_.heartbeat.any = false; }

  // Of the session: lost is what no path has brought, a duplicate what another has brought first.
  const PacketCounters& counters() const { return counters_; }
  // Of one path.
  const PacketCounters& counters(std::size_t path) const { return paths_[path].tracker.counters(); }
  std::uint64_t copies(std::size_t path) const { return paths_[path].copies; }

 private:
  struct Numbers {
    PacketTracker tracker;
    std::uint32_t pnum = 0;            // of the datagram that is looked at
    Arrival arrival = Arrival::first;  // likewise
    std::uint32_t gap = 0;             // before it
    std::uint32_t others = 0;          // that others brought first since its newest one
    std::uint32_t lost = 0;  // that were counted lost because of it, and have not come late
    std::uint64_t copies = 0;
  };
  // A datagram, as it came first: of those of one T the numbers of that path tell which is newer.
  struct First {
    bool any = false;
    std::uint32_t t_ms = 0;
    std::uint32_t pnum = 0;
    std::size_t path = 0;
  };
  bool is_new(First& newest, std::size_t path, std::uint32_t t_ms) const;
  void count_new(Numbers& path);
  void count_copy(Numbers& path);
  void count_gap(Numbers& path);
  bool take_back(Numbers& path);

  std::vector<Numbers> paths_;
  struct Newest {
    bool any = false;
    std::uint32_t t_ms = 0;
    First heartbeat, state;
    FieldSet fields;  // what the states of that T have brought
  } newest_;
  PacketCounters counters_;
  struct Told {
    std::uint32_t pnum = 0;
    Refusal code = Refusal::none;
  };
  std::array<Told, 16> told_{};  // the answers that were told last
  std::size_t answers_ = 0;
};

}  // namespace r4
