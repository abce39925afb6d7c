// SPDX-License-Identifier: GPL-3.0-or-later
// r4::Fleet: many boards on one thread.
//     r4::Fleet fleet({"can://can0?node=0-7", "udp://10.0.0.{1-250}?listen=0"});
//     fleet.wait_active();
//     fleet.arm().require();                       // throws if a board is not armed
//     fleet.post({{0, left}, {1, right}});         // setpoints of two boards, sent in one pass
//     for (const r4::BoardHealth& each : fleet.health()) …
//     fleet["can://can0?node=3"].send("S:1500,1");  // one board
//     fleet.stop();                                // all boards at once
//
// Boards count from 0, in the order of the URLs. A pattern stands for several boards in order
// (docs/how-to/fleet.md). '+' joins the paths to one board:
// "can://can0?node=0-7+can://can1?node=0-7". All links run on one thread and one loop; boards on
// one CAN bus share a socket. A silent board does not disturb the links to other boards.
// ReceivedState::sampled is comparable across boards.
//
// Thread-safe; no call blocks the links. If this object is destroyed or its process hangs, all
// boards go safe. A command that is not sent within its timeout is never sent, except a stop. If
// your thread may hang, use watchdog() and feed(). A problem of the whole call throws r4::Error:
// usage, or refused after close(). A problem of one board is an entry in the result.
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

struct BoardHealth {
  std::size_t board = 0;
  std::string url;         // as given to Fleet
  BoardIdentity identity;  // empty until the board has answered
  LinkStatus link;
  bool in_control = false;  // the board accepts this host's commands, which are sent at once
  DisarmCause disarmed_by = DisarmCause::not_yet;
  Statistics statistics;
  std::vector<PathStatus> paths;  // empty if the board has one path only
  // True if the board is ACTIVE and this host controls it, and commands are sent.
  bool well() const { return in_control && link.state == HostLinkState::active && !link.gated(); }
};

struct FleetResult {
  std::size_t board = 0;
  CommandResult result;
  Problem problem;  // with the board's URL; empty if confirmed
  bool confirmed() const { return result.outcome == Outcome::confirmed; }
};

// The results of a command, in the order in which the boards were named.
class R4LINK_API FleetResults {
 public:
  explicit FleetResults(std::vector<FleetResult> results) : results_(std::move(results)) {}
  bool all_confirmed() const;
  std::vector<std::size_t> failed() const;  // the numbers of the boards
  // If boards did not confirm, throws Error{refused} about the first unconfirmed board. The reason
  // also gives the number of other unconfirmed boards.
  void require() const;

  std::size_t size() const { return results_.size(); }
  const FleetResult& operator[](std::size_t i) const { return results_[i]; }
  auto begin() const { return results_.begin(); }
  auto end() const { return results_.end(); }

 private:
  std::vector<FleetResult> results_;
};

struct FleetEvent {
  enum class Kind : std::uint8_t {
    link,       // `link` has changed
    transport,  // `transport` is an event of the transport
    arming,     // `disarmed_by` has changed; none: armed
    restart,    // Board::on_restart()
    refused,    // the board refused the posted command `refused`
    // `count` events before this event were dropped, because next_event() was called too late
    missed,
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

  // Opens all transports and starts the links, without waiting for the boards. callback_limit has
  // no effect. Functions that wait call on_wait. Throws Error for a wrong URL or pattern, for a
  // duplicate URL, and for the first transport that cannot be opened.
  explicit Fleet(const std::vector<std::string>& patterns, BoardOptions options = {});
  ~Fleet();
  Fleet(const Fleet&) = delete;
  Fleet& operator=(const Fleet&) = delete;

  // As Board::close(), for all boards at once. Blocks for at most 100 ms.
  void close();

  std::size_t size() const;
  const std::string& url(std::size_t board) const;
  // The board with this URL, name or board id. Throws Error{usage} unless exactly one matches.
  std::size_t find(std::string_view url_or_name) const;
  FleetBoard operator[](std::size_t board);
  FleetBoard operator[](std::string_view url_or_name);

  // Waits until every board is ACTIVE and this program controls it. A watcher waits until every
  // link is active or safe. Returns the boards that are not ready.
  Boards wait_active(Duration timeout = Duration{3000});
  std::vector<BoardHealth> health() const;
  // The newest state of each board, all read at one instant.
  std::vector<ReceivedState> states() const;

  FleetResults send(const Command& command, Duration timeout = default_timeout);
  FleetResults send(const Boards& boards, const Command& command,
                    Duration timeout = default_timeout);
  // Sends a command from text: "O:358,1,1", or a group "O:358,1,1;O:358,1,2".
  FleetResults send(std::string_view text, Duration timeout = default_timeout);
  FleetResults send(const Boards& boards, std::string_view text,
                    Duration timeout = default_timeout);
  // Setpoints of several boards; each board confirms its own setpoints.
  FleetResults send(const std::vector<BoardSetpoints>& setpoints,
                    Duration timeout = default_timeout);
  FleetResults arm(Duration timeout = default_timeout);
  FleetResults arm(const Boards& boards, Duration timeout = default_timeout);

  // Sends E:STOP to all boards in one pass before it waits, and repeats E:STOP until each board has
  // confirmed the stop. One frame on each CAN bus stops all boards of the bus, also boards outside
  // the fleet. If a board does not confirm, no error is thrown. The board's result advises to cut
  // the power, and the stop is repeated to this board and its bus for timing.timeout_ms more.
  FleetResults stop(Duration timeout = default_timeout);
  void stop_async();  // as stop() with default_timeout; does not wait

  // Sends once, in one pass of the loop, without confirmation, for streams of setpoints. The
  // results are in the order of `setpoints`.
  std::vector<PostResult> post(const std::vector<BoardSetpoints>& setpoints);

  // Waits for the next event, oldest first. Empty if no event arrives. Keeps the last 4096 events.
  std::optional<FleetEvent> next_event(Duration timeout = Duration{0});

  void record(Recording& recording);

  // As Board::watchdog(): if feed() is not called for `period`, all boards go safe.
  void watchdog(Duration period);
  void feed();

 private:
  friend class FleetBoard;
  struct R4LINK_PRIVATE Impl;
  std::unique_ptr<Impl> impl_;
};

// One board of a fleet; the fleet must outlive it. Calls throw as the calls of Board do.
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

}  // namespace r4
