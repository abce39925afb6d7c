// SPDX-License-Identifier: GPL-3.0-or-later
// r4::Bridge: joins two transports (docs/how-to/bridge.md).
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "carrier.hpp"
#include "config.hpp"
#include "key.hpp"

namespace r4 {

enum class BridgeSide : std::uint8_t { hosts, board };

// Counts of the datagrams from one side of a bridge.
struct BridgeCounters {
  std::uint64_t passed = 0;  // sent to the other side
  std::uint64_t stops = 0;   // emergency stops among them
  // Dropped:
  std::uint64_t damaged = 0;      // a wrong checksum, too long, or not a datagram
  std::uint64_t misdirected = 0;  // a host sent a board's datagram, or the reverse
  std::uint64_t kept_out = 0;     // from hosts that are not served (docs/how-to/bridge.md)
  std::uint64_t refused =
      0;                   // an unsigned command that must be signed, or a setting for a cable only
  std::uint64_t late = 0;  // may have waited for more than 100 ms: the bridge was delayed
  std::uint64_t undelivered = 0;  // the other side is down or full, or its peer is unknown
  // Datagrams among `passed` that a newer state replaced, or that were dropped after 100 ms.
  std::uint64_t outdated = 0;
};

struct BridgeEnd {
  std::string name;  // the transport's name
  bool up = false;
  BridgeCounters from;
};

struct BridgeStatus {
  BridgeEnd hosts;
  BridgeEnd board;
};

struct BridgeEvent {
  std::size_t pair = 0;  // number of the board, from 0
  BridgeSide side = BridgeSide::hosts;
  CarrierEvent event;
};

struct BridgeOptions {
  // The board's keys, at most four (load_key()). With keys, only heartbeats and commands that are
  // signed with one of them pass. Stops and questions always pass.
  std::vector<Key> keys;
  // A board obeys unsigned commands on its own cable. So by default a bridge to a cable passes only
  // signed commands to a board with a key. If the hosts are on a network, a bridge to a cable is
  // refused without `keys`. True: every host that reaches the hosts' side may drive the board.
  // Cannot be combined with `keys`.
  bool open = false;
  // After this silence of the served host, another host is served; at least the board's timeout.
  std::chrono::milliseconds timeout{1000};
  // Called on the bridge's thread; must not block.
  std::function<void(const BridgeEvent&)> on_event;
};

// Passes the datagrams of hosts to a board and back, unchanged, on its own thread. Thread-safe.
//     r4::Bridge bridge("udp://0.0.0.0:2018", "can://can0?node=3");
//     r4::Bridge bus("udp://0.0.0.0:2100-2107", "can://can0?node=0-7");
//
// A bridge makes no heartbeats: if the host ends, the board goes safe. A bridge serves one host at
// a time. Every E:STOP passes. Cable-only settings never pass. A bridge waits for missing devices.
class R4LINK_API Bridge {
 public:
  // `hosts`: the URL to listen on, as for r4 sim. Patterns of equal size are paired in order
  // (docs/reference/transports.md). Throws Error: usage, permission, and errors of the transports.
  Bridge(std::string_view hosts, std::string_view board, BridgeOptions options = {});
  ~Bridge();
  Bridge(const Bridge&) = delete;
  Bridge& operator=(const Bridge&) = delete;

  // Ends the bridge at once; the boards go safe after their timeouts. Idempotent.
  void close();

  std::size_t size() const;  // number of boards
  // The status of each pair, in order; after close(), the last status.
  std::vector<BridgeStatus> status() const;

 private:
  struct R4LINK_PRIVATE Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace r4
