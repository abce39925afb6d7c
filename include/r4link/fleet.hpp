// SPDX-License-Identifier: GPL-3.0-or-later
// r4::Fleet: many boards on one thread, opened by URLs and by patterns of URLs. r4::Bridge: the same boards for hosts on
// another transport, at the end.
//
//     r4::Fleet fleet({"can://can0?node=0-7", "udp://10.0.0.{1-250}?listen=0"});
//     fleet.wait_active();
//     fleet.arm().require();                       // throws, naming those that cannot be armed
//     fleet.post({{0, left}, {1, right}});         // setpoints of two boards, out in one pass
//     for (const r4::BoardHealth& each : fleet.health()) …
//     fleet["can://can0?node=3"].send("S:1500,1");  // one of them
//     fleet.stop();                                // all of them, at once
//
// Boards count from 0, in the order of the URLs; a pattern stands for its boards in order (docs/fleet.md), and '+' joins
// several paths to a board: "can://can0?node=0-7+can://can1?node=0-7". Their links live on one thread and one loop; those
// on a CAN bus share one socket. Each is a link of its own: a board that is silent disturbs no other one, and every
// state has its time on this computer's clock (ReceivedState::sampled).
//
// Thread-safe, and nothing here blocks the links. As with a Board, each board goes safe by itself when this object
// is gone or its process hangs, what has not been sent by its timeout never is, and only a stop goes out in any
// case. A program whose own thread may hang says watchdog() and feed().
//
// What concerns the whole call throws r4::Error: usage for what cannot be sent, refused when the fleet was closed.
// What concerns one board of many is its entry in the result.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "carrier.hpp"
#include "config.hpp"
#include "key.hpp"
#include "link.hpp"
#include "options.hpp"
#include "recording.hpp"
#include "setpoints.hpp"

namespace r4 {

// How a board of a fleet is.
struct BoardHealth {
  std::size_t board = 0;
  std::string url;         // that it was opened by
  BoardIdentity identity;  // empty until it has answered
  LinkStatus link;
  bool in_control = false;  // commands go out at once
  DisarmCause disarmed_by = DisarmCause::not_yet;
  Statistics statistics;
  std::vector<PathStatus> paths;  // of several; of one alone it is empty
  // Its commands go out and nothing is wrong: ACTIVE and in control.
  bool well() const { return in_control && link.state == HostLinkState::active && !link.gated(); }
};

// What became of a command at one board.
struct FleetResult {
  std::size_t board = 0;
  CommandResult result;
  Problem problem;  // in words, with the board's URL; of a confirmed one empty
  bool confirmed() const { return result.outcome == Outcome::confirmed; }
};

// What became of a command at several boards, in the order in which they were named.
class R4LINK_API FleetResults {
 public:
  explicit FleetResults(std::vector<FleetResult> results) : results_(std::move(results)) {}
  bool all_confirmed() const;
  std::vector<std::size_t> failed() const;  // the boards
  // Throws Error{refused} if not all are confirmed: the first that is not, and how many others.
  void require() const;

  std::size_t size() const { return results_.size(); }
  const FleetResult& operator[](std::size_t i) const { return results_[i]; }
  auto begin() const { return results_.begin(); }
  auto end() const { return results_.end(); }

 private:
  std::vector<FleetResult> results_;
};

// Something that happened to a board.
struct FleetEvent {
  enum class Kind : std::uint8_t {
    link,       // `link` is another
    transport,  // `transport` tells
    arming,     // `disarmed_by` is another; none: armed
    restart,    // the board has begun again: what it was told is gone
    refused,    // a command that post() took was refused: `refused`
    missed,     // this many events were dropped before this one, for nobody took them: `count`
  };
  Kind kind = Kind::link;
  std::size_t board = 0;
  LinkStatus link{};
  CarrierEvent transport{};
  DisarmCause disarmed_by = DisarmCause::not_yet;
  RefusedPost refused{};
  std::uint64_t count = 0;
};
// "link", "transport", "arming", "restart", "refused", "missed"; "unknown" for other numbers.
constexpr const char* to_text(FleetEvent::Kind kind) {
  switch (kind) {
    case FleetEvent::Kind::link:
      return "link";
    case FleetEvent::Kind::transport:
      return "transport";
    case FleetEvent::Kind::arming:
      return "arming";
    case FleetEvent::Kind::restart:
      return "restart";
    case FleetEvent::Kind::refused:
      return "refused";
    case FleetEvent::Kind::missed:
      return "missed";
  }
  return "unknown";
}

// Output commands for one board, executed together there.
struct BoardSetpoints {
  std::size_t board = 0;
  Setpoints setpoints;
};

class FleetBoard;

class R4LINK_API Fleet {
 public:
  using Duration = std::chrono::milliseconds;
  using Boards = std::vector<std::size_t>;
  static constexpr Duration default_timeout{1000};

  // Opens all transports and begins the links; returns without waiting for the boards. Options are those of each
  // board (callback_limit is of no use here; on_wait is called by calls that wait). Throws Error: for a wrong URL
  // or pattern, for one that stands twice, and for the first transport that cannot be opened.
  explicit Fleet(const std::vector<std::string>& patterns, BoardOptions options = {});
  ~Fleet();
  Fleet(const Fleet&) = delete;
  Fleet& operator=(const Fleet&) = delete;

  // As Board::close(), of all at once. At most 100 ms.
  void close();

  std::size_t size() const;
  const std::string& url(std::size_t board) const;
  // The board of that URL, name or board id, as far as it has told them. Throws Error{usage} if there is none, or
  // more than one.
  std::size_t find(std::string_view url_or_name) const;
  FleetBoard operator[](std::size_t board);
  FleetBoard operator[](std::string_view url_or_name);

  // --- all of them, or those that are named

  // Waits until all are ACTIVE under our control (where the program only watches: are heard). Returns those that
  // are not by then.
  Boards wait_active(Duration timeout = Duration{3000});
  std::vector<BoardHealth> health() const;
  // The newest state of each, at one instant.
  std::vector<ReceivedState> states() const;

  FleetResults send(const Command& command, Duration timeout = default_timeout);
  FleetResults send(const Boards& boards, const Command& command,
                    Duration timeout = default_timeout);
  // The same from text: "O:358,1,1", or a group "O:358,1,1;O:358,1,2".
  FleetResults send(std::string_view text, Duration timeout = default_timeout);
  FleetResults send(const Boards& boards, std::string_view text,
                    Duration timeout = default_timeout);
  // Setpoints of several boards, each confirmed by its own.
  FleetResults send(const std::vector<BoardSetpoints>& setpoints,
                    Duration timeout = default_timeout);
  FleetResults arm(Duration timeout = default_timeout);
  FleetResults arm(const Boards& boards, Duration timeout = default_timeout);

  // E:STOP to all in one pass, before this waits for anything: by one frame on each CAN bus, which stops all its
  // boards, ours or not; repeated until each has confirmed it. Does not throw where boards do not confirm: their
  // results say to cut the power, and it is repeated to them for default_timeout behind the call. On a CAN bus that
  // stops all its boards again.
  FleetResults stop(Duration timeout = default_timeout);
  void stop_async();  // does not wait; repeated for default_timeout

  // Setpoints sent once, in one pass of the loop, and not confirmed: which were sent, in their
  // order. For streams.
  std::vector<PostResult> post(const std::vector<BoardSetpoints>& setpoints);

  // The next thing that has happened, oldest first; none if there is nothing in time. The newest 4096 are kept.
  std::optional<FleetEvent> next_event(Duration timeout = Duration{0});

  // Every datagram of every board from now on goes into that recording, too.
  void record(Recording& recording);

  // As of Board, for all boards: without feed() for `period` the heartbeats stop, and all go safe.
  void watchdog(Duration period);
  void feed();

 private:
  friend class FleetBoard;
  struct R4LINK_PRIVATE Impl;
  std::unique_ptr<Impl> impl_;
};

// One board of a fleet, which must outlive it. Calls throw as those of Board do.
class R4LINK_API FleetBoard {
 public:
  using Duration = Fleet::Duration;

  std::size_t index() const { return board_; }
  const std::string& url() const { return fleet_->url(board_); }

  void send(const Command& command, Duration timeout = Fleet::default_timeout);
  void send(const Setpoints& setpoints, Duration timeout = Fleet::default_timeout);
  void send(std::string_view text, Duration timeout = Fleet::default_timeout);
  PostResult post(const Setpoints& setpoints);
  void arm(Duration timeout = Fleet::default_timeout);
  void stop(Duration timeout = Fleet::default_timeout);
  BoardIdentity identify(Duration timeout = Fleet::default_timeout);
  void wait_active(Duration timeout = Duration{3000});

  ReceivedState state() const;
  BoardHealth health() const;

 private:
  friend class Fleet;
  FleetBoard(Fleet& fleet, std::size_t board) : fleet_(&fleet), board_(board) {}
  Fleet* fleet_;
  std::size_t board_;
};

// --- two transports joined: a gateway to a board (docs/bridge.md)

enum class BridgeSide : std::uint8_t { hosts, board };

// What came from one side of a bridge, in datagrams, and what became of it.
struct BridgeCounters {
  std::uint64_t passed = 0;  // to the other side
  std::uint64_t stops = 0;   // of those: emergency stops
  // Dropped:
  std::uint64_t damaged = 0;  // a wrong checksum, too long, or no datagram at all
  std::uint64_t misdirected =
      0;  // what only a board says from the hosts' side, or the other way round
  std::uint64_t kept_out = 0;  // of hosts that are not served: docs/bridge.md
  std::uint64_t refused =
      0;  // not signed though it must be, or a setting that only a cable may change
  std::uint64_t late = 0;         // may have waited for more than 100 ms: the bridge was held up
  std::uint64_t undelivered = 0;  // the other side is away, takes no more, or nobody is known there
  // Of what passed: a newer state took its place in front of the other side, or it waited there for 100 ms.
  std::uint64_t outdated = 0;
};

struct BridgeEnd {
  std::string name;  // of the transport
  bool up = false;
  BridgeCounters from;
};

// One board and its hosts.
struct BridgeStatus {
  BridgeEnd hosts;
  BridgeEnd board;
};

// A transport went down, came up or has a warning.
struct BridgeEvent {
  std::size_t pair = 0;  // which board, from 0
  BridgeSide side = BridgeSide::hosts;
  CarrierEvent event;
};

struct BridgeOptions {
  // The board's keys, at most four (load_key()). With one the bridge passes only heartbeats and
  // commands that are signed with it, as a board does that is reached by radio; stops and questions
  // pass without.
  std::vector<Key> keys;
  // A board obeys its own cable without a signature. Unless this is set, a bridge to a cable
  // therefore passes nothing unsigned to a board that has a key, and is refused on a network
  // without `keys`. Set it, and everyone who reaches the hosts' side may drive the board.
  bool open = false;
  // After so long without a heartbeat of the host that has the place another one gets it: no shorter than the
  // board's timeout.
  std::chrono::milliseconds timeout{1000};
  // Called on the bridge's thread, which it must not hold up.
  std::function<void(const BridgeEvent&)> on_event;
};

// Carries the datagrams of hosts to a board and back, as they are, on a thread of its own:
//
//     r4::Bridge bridge("udp://0.0.0.0:2018", "can://can0?node=3");
//     r4::Bridge bus("udp://0.0.0.0:2100-2107", "can://can0?node=0-7");
//
// It makes no heartbeat: a board whose host has died goes safe. Of several hosts one at a time is let through, and
// E:STOP of any. A device that is not there, or goes, is waited for. What only a cable may set
// (C:key, C:network …) never passes. Thread-safe.
class R4LINK_API Bridge {
 public:
  // `hosts`: where hosts are heard, as r4 sim takes it; `board`: as a host takes it. Patterns of as many boards
  // (docs/fleet.md) are joined in order. Throws Error: usage, permission, and what a port cannot be opened for.
  Bridge(std::string_view hosts, std::string_view board, BridgeOptions options = {});
  ~Bridge();
  Bridge(const Bridge&) = delete;
  Bridge& operator=(const Bridge&) = delete;

  // Ends it at once; the boards go safe after their timeout. Can be called twice.
  void close();

  std::size_t size() const;  // boards
  // Of each, in order; after close(), how it was then.
  std::vector<BridgeStatus> status() const;

 private:
  struct R4LINK_PRIVATE Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace r4
