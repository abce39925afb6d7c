// SPDX-License-Identifier: GPL-3.0-or-later
// Joins two carriers of one loop: one hears hosts, the other leads to their board.
//     hosts --> E:STOP                 first of all, of any peer, however old
//               heartbeats, commands   if they are signed as they must be (bridge_guard.hpp): of
//                                      served hosts (bridge_hosts.hpp) at once, of other hosts
//                                      within a budget
//               Q:ID                   of any peer, likewise
//     board --> heartbeats             to served hosts and watchers (bridge_audience.hpp), and for
//                                      a second to each other host
//               states                 to served hosts and watchers
//               N, I                   to the session that they name if it is served, else to the
//                                      peer that asked
//
// The bytes stay as they are. A datagram that may have waited for longer than `oldest` before it
// was read is dropped, unless it is a stop: a delayed datagram must not be executed, or keep a
// board alive. The carriers' queues bound the time before sending likewise. Settings that a board
// takes only from its own cable (site_settings.hpp) never pass. Otherwise a bridge would turn
// everyone who reaches it into that cable, and would carry keys and passwords over a network.
//
// A bridge makes no heartbeat. It answers BUSY to a host that is kept out, AUTH to a datagram that
// must not pass, and LEASE to a watcher, because all of a bridge's watchers are one peer to the
// board. While no host is served, the bridge itself watches the board (bridge_watch.hpp).
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "../../protocol/link/answer_budget.hpp"
#include "../../transports/board_end.hpp"
#include "bridge_audience.hpp"
#include "bridge_guard.hpp"
#include "bridge_hosts.hpp"
#include "bridge_watch.hpp"
#include "r4link/bridge.hpp"
#include "r4link/carrier.hpp"
#include "r4link/control/boot_clock.hpp"
#include "r4link/datagram.hpp"
#include "r4link/messages/datagram_writer.hpp"
#include "waiting_time.hpp"

namespace r4 {

// More than 15 members: the two sides, and a class for each rule that a datagram passes.
class BridgedPair {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr std::chrono::milliseconds oldest{100};
  static constexpr std::chrono::milliseconds try_again{500};

  struct Setup {
    std::unique_ptr<Carrier> hosts;
    std::unique_ptr<Carrier> board;
    // True if the side of hosts may be absent at first, as a device may. A listening port may not.
    bool hosts_may_be_away = false;
    std::chrono::milliseconds timeout{1000};  // the board's
    std::vector<Key> keys;                    // the board's
    bool trusted = false;                     // as in BridgeGuard
    // Counts while this computer sleeps, so that datagrams from before the sleep are old.
    std::function<Time()> now = [] { return Time(BootClock::now().time_since_epoch()); };
    std::function<void(BridgeSide, const CarrierEvent&)> on_event;
  };

  explicit BridgedPair(Setup setup);
  ~BridgedPair() { close(); }
  BridgedPair(const BridgedPair&) = delete;
  BridgedPair& operator=(const BridgedPair&) = delete;

  // Throws Error for a fault that does not end by itself.
  void open();
  void close() noexcept;
  // Call it every WaitingTime::tick_interval.
  void tick();
  BridgeStatus status() const;

 private:
  struct Side final : Carrier::Handler {
    Side(BridgedPair& owner, BridgeSide side, std::unique_ptr<Carrier> by)
        : pair(owner), which(side), carrier(std::move(by)), end(board_end_of(*carrier)) {}
    void on_datagram(std::string_view bytes, Peer from) override;
    void on_carrier_event(const CarrierEvent& event) override;
    void on_drained() override { waiting.on_drained(pair.now_()); }
    void on_oversize(std::string_view) override { ++counters.damaged; }

    BridgedPair& pair;
    const BridgeSide which;
    const std::unique_ptr<Carrier> carrier;
    BoardEnd& end;
    bool opened = false;
    std::string obstacle;  // why it could not be opened, as last reported
    Time tried;
    WaitingTime waiting;
    BridgeCounters counters;
    std::uint64_t refused = 0;  // datagrams that its carrier dropped because it did not take them
  };

  void on_host_datagram(const Datagram& datagram, Peer from, Time now);
  void on_board_datagram(const Datagram& datagram, Time now);
  void on_command(const Datagram& datagram, Peer from, Time now);
  void on_lease(const Datagram& datagram, Peer from, Time now);
  bool is_allowed(const Datagram& datagram, MessageKind kind, Peer from, Time now);
  void on_answer(const Datagram& answer, MessageKind kind, Time now);
  void deliver_to_hosts(const Datagram& datagram, bool is_state, Time now);
  bool may_ask(Time now);
  bool is_judged(const Datagram& heartbeat) const;
  void follow_hosts(Time now);
  void watch_board(Time now);
  void report_trouble();
  void answer(const Datagram& asked, Refusal code, std::uint32_t lease, Peer to, Time now,
              std::optional<std::uint32_t> session = std::nullopt);
  void deliver(Side& from, Side& to, const Datagram& datagram, Priority priority,
               Peer peer = everyone);
  void pass_on(const Datagram& datagram, Peer from, bool trusted, Time now);
  bool send(Side& to, std::string_view bytes, Priority priority, Peer peer);
  bool is_old(Side& side, Time now);
  // Only an absence, such as of an unplugged device, may end by itself.
  enum class Failure : std::uint8_t { throws, throws_unless_absent, is_reported };
  void try_to_open(Side& side, Failure failure, Time now);

  const bool hosts_may_be_away_;
  const std::function<Time()> now_;
  const std::function<void(BridgeSide, const CarrierEvent&)> on_event_;
  Side hosts_;
  Side board_;
  const std::chrono::milliseconds timeout_;
  BridgeHosts known_;
  BridgeGuard guard_;
  BridgeAudience audience_;
  BridgeWatch watch_;
  // For peers that have proved nothing: datagrams to the board, answers to W, and heartbeats.
  AnswerBudget asking_, leases_, copies_;
  BridgeGuard::Trouble reported_ = BridgeGuard::Trouble::none;
  // The board's newest number and clock, for answers in its place.
  bool board_known_ = false;
  std::uint32_t board_pnum_ = 0;
  std::uint64_t board_t_ = 0;
  Time board_heard_;
};

}  // namespace r4
