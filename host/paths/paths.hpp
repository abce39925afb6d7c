// SPDX-License-Identifier: GPL-3.0-or-later
// The paths over which a session has its board: to which of them it speaks, and what of all that they bring is new.
// Without I/O, part of a session (docs/redundancy.md). Nobody else knows how many there are.
//
//             up           its board says who it is           something comes
//     down -------> asking ------------------------> silent <----------------> carrying
//                    |  ^                                     for the timeout
//        another is  |  |   it is asked every second,        nothing
//        there       v  |   and says who it is
//                   other
//
//     down leads out of each of them to `down`; an answer of another board from each to `other`. Where there is
//     nothing to compare with (the only path; a bus on which this program may not ask) `asking` is passed by
//
// Until its board has said who it is, a path is sent nothing but the question and stops, and what it brings is
// passed over. The board that answers first is the session's, unless all other paths lead elsewhere. The session begins
// when all paths that are up have answered, or 300 ms after the first.
//
// Each path has the board's packet numbers of its own; so what is newest is told by T. A path also has its view of
// the board's clock, by the answers to its own questions: a T that does not fit it, of a board that has begun again
// or of a path that brings what is old, is passed over, and the path is asked. An answer that was asked for after the
// newest other answer, and whose T fits no more, shows that the board has begun again. A board that does not answer (the
// paper's release) is believed what it sends.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "../../protocol/link/host_link.hpp"
#include "../../protocol/messages/message.hpp"
#include "lease.hpp"
#include "path.hpp"
#include "path_news.hpp"
#include "r4link/link.hpp"

namespace r4 {

class Paths {
 public:
  // `link`: what the session knows of the board.
  Paths(std::size_t count, LinkTiming timing, const HostLink& link)
      : paths_(count),
        timeout_(std::chrono::milliseconds{timing.timeout_ms}),
        link_(link),
        news_(count),
        leases_(count) {}

  std::size_t count() const { return paths_.size(); }

  // --- the transports

  // `can_ask`: not where who watches may say nothing, on a bus. Such a path is believed what its URL says while it is the
  // only one; beside others the T that it brings must fit the board's clock, which begins at random.
  void on_transport(std::size_t index, bool up, bool can_ask, Time now);
  bool all_down() const;
  // This computer slept: who the board is counts on, but each path has to say again what the
  // board's clock is.
  void on_sleep(Time now);

  // --- to which of them the session speaks

  // Heartbeats, leases and commands: none before the session has begun.
  PathSet speaking() const { return begun_ ? known() : PathSet{0}; }
  bool begun() const { return begun_; }
  bool is_known(std::size_t index) const { return paths_[index].known; }
  // Those that are to be asked now who their board is, by one question.
  PathSet to_ask(Time now) const;
  void asked(std::size_t index, std::uint32_t pnum, Time now);
  // Lets time pass; true if the session begins.
  bool poll(Time now);
  Time next(Time now) const;

  // --- what they bring, in two steps: is it of the session's board as it is now, and is it new?

  enum class Admission : std::uint8_t {
    no,
    restarted,  // yes, and it shows that the board has begun again
    yes,
  };
  // A state or a heartbeat.
  Admission admit(std::size_t index, std::uint32_t pnum, std::uint32_t t_ms, Time now);
  // An answer. `counts`: its number is among those of the states.
  bool admit_answer(std::size_t index, std::uint32_t pnum, std::uint32_t t_ms, bool counts,
                    Time now);
  // The answer to who the board is.
  Admission admit_identity(std::size_t index, const Identity& identity, std::uint32_t t_ms,
                           Time now);
  // A heartbeat that says that the board is booting. True if that is so.
  bool admit_connecting(std::size_t index, Time now);

  // Is it new, and what is lost?
  PathNews& news() { return news_; }
  // Is nothing newer known of the board? Then it is the newest.
  bool is_newest(std::uint32_t t_ms, Time now);

  // --- who has the board

  // The board, at its time `t_ms`, has answered BUSY there; none: a transport hears another host in our place.
  void on_busy(std::size_t index, std::optional<std::uint32_t> t_ms, Time now);
  // A state of its time `t_ms` shows that the board is ours: a BUSY from before that says nothing any more.
  void on_own_state(std::uint32_t t_ms, Time now) { own_ = {true, now, t_ms}; }
  // Do all that are heard say that another host has the board?
  bool all_busy(Time now) const;
  // For so long they do, if none is answered again.
  Time all_busy_until(Time now) const;

  // Of who watches: one for each path.
  Leases& leases() { return leases_; }
  const Leases& leases() const { return leases_; }

  // --- in numbers

  PathSet carrying(Time now) const;
  bool two_boards() const;
  // All of it but its name.
  Wire report(std::size_t index, Time now) const;
  const PacketCounters& counters() const { return news_.counters(); }

 private:
  static constexpr Time ask_interval = std::chrono::milliseconds{100};
  static constexpr Time ask_other_interval = std::chrono::seconds{1};
  static constexpr Time patience = std::chrono::milliseconds{300};
  // So many questions that a board does not answer while it sends what does not fit make a path believed.
  static constexpr int most_unanswered = 10;
  // As that of a role (host_role.hpp).
  static constexpr Time busy_memory = std::chrono::milliseconds{300};
  // An older state is not compared with: the board's T wraps.
  static constexpr Time own_state_memory = std::chrono::hours{1};

  bool is_only(const Path& path) const { return paths_.size() == 1 && &path == paths_.data(); }
  PathSet known() const;
  static bool is_heard(const Path& path, Time now) { return path.known && now < path.heard_until; }
  void hear(Path& path, Time now) const;
  static bool is_believed(const Path& path) {
    return !path.can_ask || (path.known && (!path.questions.answered ||
                                            path.questions.unanswered >= most_unanswered));
  }
  static bool in_clock(const Path& path, std::uint32_t t_ms, Time now);
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
  bool all_connecting(Time now) const;
  bool others_carry(const Path& path, Time now) const;
  bool refuses(const Path& path, Time now) const;
  WireState state(const Path& path, Time now) const;

  std::vector<Path> paths_;
  Time timeout_;
  const HostLink& link_;
  std::optional<std::string> id_;  // of the session's board
  bool begun_ = false;
  bool anew_ = true;  // nothing has come since all paths were down
  Time first_answer_{0};
  std::uint32_t boot_ = 0;
  Time proven_{0};   // when the newest proof of the boot came
  PathClock clock_;  // by what is newest
  struct OwnState {
    bool any = false;
    Time at{0};
    std::uint32_t t_ms = 0;
  } own_;
  PathNews news_;
  Leases leases_;
};

}  // namespace r4
