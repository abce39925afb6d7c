// SPDX-License-Identifier: GPL-3.0-or-later
// Decides over which paths a session sends, and which datagrams it admits
// (docs/how-to/redundancy.md). A part of a session, without I/O. Of the other parts, only
// LinkKeeper uses the number of paths: it sends a lease over each path.
//             up           its board answers Q:ID             a datagram comes
//     down -------> asking -----------------------> silent <-------------------> carrying
//                    |  ^                                    none for the timeout
//     another board  |  |  asked every second,
//     answers        v  |  it gives the right id
//                   other
//
// Each state leads to `down`. An answer of another board leads from each state to `other`. The only
// path, and a bus on which this program must not send Q:ID, skip `asking`.
//
// Before its board has answered, a path carries only Q:ID and stops, and its datagrams are dropped.
// Unless all other paths lead to another board, the first board that answers is the session's. The
// session begins when all paths that are up have answered, or 300 ms after the first answer.
//
// Packet numbers differ between paths, so the board's time T decides which datagram is newest. Each
// path has its own estimate of the board's clock. If a datagram's T does not fit, the datagram is
// late, or the board has restarted: the datagram is dropped, and Q:ID is sent. If the T of the
// answer does not fit either, and the question was sent after the newest answer of the known boot,
// the answer proves a restart. A board without Q:ID (the paper's release) is trusted.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "../../protocol/link/host_link.hpp"
#include "../../protocol/messages/message.hpp"
#include "path.hpp"
#include "path_news.hpp"
#include "r4link/link.hpp"

namespace r4 {

// More than 40 functions, because each fact about one path has a private function.
class Paths {
 public:
  Paths(std::size_t count, LinkTiming timing, const HostLink& link)
      : paths_(count),
        timeout_(std::chrono::milliseconds{timing.timeout_ms}),
        link_(link),
        news_(count) {}

  std::size_t count() const { return paths_.size(); }

  // `can_ask`: false for a watcher on a bus, which must not send Q:ID. Then the only path is
  // trusted. With other paths, T must fit the board's clock, which starts at random.
  void on_transport(std::size_t index, bool up, bool can_ask, Time now);
  bool all_down() const {
    return those([](const Path& path) { return path.up; }) == 0;
  }
  // After a sleep or days of silence, the board's clock is unknown on every path. The ids are kept.
  void on_sleep(Time now);

  // The paths for heartbeats, leases and commands: none before the session has begun.
  PathSet speaking() const { return begun_ ? known() : PathSet{0}; }
  bool begun() const { return begun_; }
  bool is_known(std::size_t index) const { return paths_[index].known; }
  // The paths on which Q:ID is due.
  PathSet to_ask(Time now) const;
  void asked(std::size_t index, std::uint32_t pnum, bool sent, Time now);
  // True if the session begins.
  bool poll(Time now);
  Time next(Time now) const;

  // --- receiving, in two steps: admit a datagram of the board's present boot, then call news()

  enum class Admission : std::uint8_t {
    no,
    restarted,  // admitted; the board has restarted
    yes,
  };
  Admission admit(std::size_t index, std::uint32_t pnum, std::uint32_t t_ms, Time now);
  // An answer to this session. `counts`: the answer is numbered with the states.
  bool admit_answer(std::size_t index, std::uint32_t pnum, std::uint32_t t_ms, bool counts,
                    Time now);
  Admission admit_identity(std::size_t index, const Identity& identity, std::uint32_t t_ms,
                           Time now);
  // A heartbeat `PNum:0`, which reports that the board is booting. True if admitted.
  bool admit_connecting(std::size_t index, Time now);

  PathNews& news() { return news_; }
  // True if no datagram with a newer T was admitted: this T then sets the board's clock.
  bool is_newest(std::size_t index, std::uint32_t t_ms, Time now);

  // The board answered BUSY at its time `t_ms`. Without `t_ms`, a transport on CAN has received
  // frames of another host with the same ids.
  void on_busy(std::size_t index, std::optional<std::uint32_t> t_ms, Time now) {
    paths_[index].busy = {now + busy_memory, t_ms};
  }
  // A state with the board's time `t_ms` names a command of this session, so an older BUSY is void.
  void on_own_state(std::uint32_t t_ms, Time now) { own_ = {now, t_ms}; }
  // If BUSY holds on all paths that carry: until when. Empty if a path carries without BUSY.
  std::optional<Time> all_busy_until(Time now) const;

  // --- a watcher's leases

  Lease& lease(std::size_t index) { return paths_[index].lease; }
  // When the next lease is due.
  Time next_lease() const;
  bool streaming(Time now) const {
    return those([now](const Path& path) { return path.lease.streaming(now); }) != 0;
  }
  LinkCauses lease_causes(Time now) const;

  PathSet carrying(Time now) const {
    return those([now](const Path& path) { return is_heard(path, now); });
  }
  bool two_boards() const {
    return those([](const Path& path) { return path.other; }) != 0;
  }
  PathStatus report(std::size_t index, Time now) const;
  const PacketCounters& counters() const { return news_.counters(); }

 private:
  static constexpr Time ask_interval = std::chrono::milliseconds{100};
  static constexpr Time ask_other_interval = std::chrono::seconds{1};
  static constexpr Time patience = std::chrono::milliseconds{300};
  // After this many unanswered questions the board is trusted without an answer.
  static constexpr int most_unanswered = 10;
  // A heartbeat is sent at least every 100 ms, and the board answers each.
  static constexpr Time busy_memory = std::chrono::milliseconds{300};
  // T wraps, so BUSY is not compared with a state that is older than this.
  static constexpr Time own_state_memory = std::chrono::hours{1};

  template <class Predicate>
  PathSet those(Predicate is_one) const {
    PathSet set = 0;
    for (std::size_t i = 0; i < paths_.size(); ++i) {
      if (is_one(paths_[i])) set |= path_bit(i);
    }
    return set;
  }
  bool is_only() const { return paths_.size() == 1; }
  static std::int32_t late_of(const Path& path) {
    return path.connecting ? PathClock::restart_tolerance_ms : PathClock::tolerance_ms;
  }
  PathSet known() const {
    return those([](const Path& path) { return path.known; });
  }
  static bool is_heard(const Path& path, Time now) { return path.known && now < path.heard_until; }
  void hear(Path& path, Time now) const;
  static bool is_believed(const Path& path) {
    return !path.can_ask || (path.known && (!path.questions.answered ||
                                            path.questions.unanswered >= most_unanswered));
  }
  static bool in_clock(const Path& path, std::uint32_t t_ms, Time now) {
    return path.clock && path.clock->fits(t_ms, now, now, late_of(path));
  }
  bool fits(const Path& path, std::uint32_t t_ms, Time now) const;
  bool fits_others(const Path& path, std::uint32_t t_ms, Time now) const;
  bool is_of_this_boot(const Path& path, std::uint32_t t_ms, Time now) const {
    return path.known && path.boot == boot_ && in_clock(path, t_ms, now);
  }
  void set_clock(std::size_t index, std::uint32_t t_ms, Time now);
  void begin_boot(std::uint32_t t_ms, Time now);
  static void ask_soon(Path& path, Time now);
  void compare_those_that_listen(std::uint32_t t_ms, Time now);
  static void turn_away(Path& path);
  bool refuses(const Path& path, Time now) const;
  PathState state(const Path& path, Time now) const;

  std::vector<Path> paths_;
  Time timeout_;
  const HostLink& link_;
  std::optional<std::string> id_;  // of the session's board
  bool begun_ = false;
  bool anew_ = true;  // no datagram has arrived since all paths were down
  Time first_answer_{0};
  std::uint32_t boot_ = 0;
  Time proven_{0};                  // the time of the last proof of the boot
  std::optional<PathClock> clock_;  // from the newest T of all paths
  struct OwnState {
    Time at{0};
    std::uint32_t t_ms = 0;
  };
  std::optional<OwnState> own_;
  PathNews news_;
};

}  // namespace r4
