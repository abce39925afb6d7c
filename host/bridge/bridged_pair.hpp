// SPDX-License-Identifier: GPL-3.0-or-later
// Joins two carriers of one loop. The first leads to hosts, the second to their board.
//     hosts --> E:STOP                 before all other datagrams, from any peer, of any age
//               heartbeats, commands   if their signature suffices (bridge_guard.hpp): from served
//                                      hosts (bridge_hosts.hpp) at once, from other hosts within a
//                                      budget
//               Q:ID                   from served hosts at once, from other peers within a budget
//     board --> heartbeats             to served hosts, watchers, listeners (bridge_audience.hpp)
//               states                 to served hosts and watchers (watchers.hpp)
//               N, I                   to the named session if it is served, else to the peer that
//                                      asked
//
// The bytes do not change. A datagram is dropped if it may have waited for longer than `oldest`
// before it was read. A delayed datagram must not be executed, or keep a board active. A stop is
// not dropped. The carriers' queues limit the time before sending in the same way. Settings that a
// board accepts only from its own cable (site_settings.hpp) never pass. Otherwise every host of the
// bridge could change them, and the bridge would carry keys and passwords over a network.
//
// A bridge sends no heartbeat of its own. The bridge answers BUSY to a host that is kept out, and
// AUTH to a datagram that must not pass. A watcher gets LEASE, because all watchers of a bridge are
// one peer to the board. While no host is served, the bridge watches the board (bridge_watch.hpp).
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "../../protocol/link/answer_budget.hpp"
#include "../../protocol/link/watchers.hpp"
#include "../../transports/board_end.hpp"
#include "bridge_audience.hpp"
#include "bridge_guard.hpp"
#include "bridge_hosts.hpp"
#include "bridge_watch.hpp"
#include "r4link/bridge.hpp"
#include "r4link/carrier.hpp"
#include "r4link/control/boot_clock.hpp"
#include "r4link/datagram.hpp"
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
    // True if the hosts' side may be absent at first: a device may, a listening port may not.
    bool hosts_may_be_away = false;
    std::chrono::milliseconds timeout{1000};  // the board's
    std::vector<Key> keys;                    // the board's
    bool trusted = false;                     // as in BridgeGuard
    // Advances while this computer sleeps, so that datagrams from before the sleep are old.
    std::function<Time()> now = [] { return Time(BootClock::now().time_since_epoch()); };
    std::function<void(BridgeSide, const CarrierEvent&)> on_event;
  };

  explicit BridgedPair(Setup setup);
  ~BridgedPair() { close(); }
  BridgedPair(const BridgedPair&) = delete;
  BridgedPair& operator=(const BridgedPair&) = delete;

  // Throws Error for a permanent fault.
  void open();
  void close() noexcept;
  // Call tick() every WaitingTime::tick_interval.
  void tick();
  BridgeStatus status() const;

 private:
  struct Side final : Carrier::Handler {
    Side(BridgedPair& owner, BridgeSide side, std::unique_ptr<Carrier> by, bool away)
        : pair(owner), which(side), carrier(std::move(by)), may_be_away(away) {}
    void on_datagram(std::string_view bytes, Peer from) override;
    void on_carrier_event(const CarrierEvent& event) override;
    void on_drained() override { waiting.on_drained(pair.now_()); }
    void on_oversize(std::string_view) override { ++counters.damaged; }

    BridgedPair& pair;
    const BridgeSide which;
    const std::unique_ptr<Carrier> carrier;
    const bool may_be_away;  // at first
    BoardEnd& end = board_end_of(*carrier);
    bool opened = false;
    std::string obstacle;  // why this side could not be opened, as reported last
    Time tried;
    WaitingTime waiting;
    BridgeCounters counters;
    std::uint64_t refused = 0;  // datagrams that its carrier did not accept, and counts as dropped
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
  // Reports why a side cannot be opened. Throws for a permanent fault, unless `may_fail`.
  void try_to_open(Side& side, bool may_fail, Time now);

  const std::function<Time()> now_;
  const std::function<void(BridgeSide, const CarrierEvent&)> on_event_;
  Side hosts_;
  Side board_;
  const std::chrono::milliseconds timeout_;
  BridgeHosts known_;
  BridgeGuard guard_;
  BridgeAudience audience_;
  Watchers watchers_;
  std::random_device random_;
  BridgeWatch watch_;
  // Budgets for untrusted peers: datagrams to the board, refusals of W, and heartbeats.
  AnswerBudget asking_, refusals_, copies_;
  BridgeGuard::Trouble reported_ = BridgeGuard::Trouble::none;
  // The board's newest packet number and clock, for answers in place of the board.
  std::uint32_t board_pnum_ = 0;
  std::uint64_t board_t_ = 0;
  std::optional<Time> board_heard_;
};

}  // namespace r4
