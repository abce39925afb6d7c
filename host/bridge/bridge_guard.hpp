// SPDX-License-Identifier: GPL-3.0-or-later
// Decides by keys which host datagrams a bridge may pass to its board. A board obeys its own cable
// without a signature. A bridge must not give its hosts the same right:
//     keys    board                        heartbeats and commands pass
//     given   any                          if they are signed for this board, once, within 250 ms
//     none    at no cable, or open to all  always; the board itself checks signatures
//     none    at a cable, has no key       always
//     none    at a cable, has a key        never: the bridge cannot check signatures
//     none    at a cable, not heard yet    never
//
// A bridge checks as the board does (protocol/keys/authentication.hpp), with the nonce and clock
// that the board reports. E:STOP, Q:ID and W need no signature, as at the board.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <vector>

#include "../../protocol/keys/authentication.hpp"
#include "../../protocol/messages/message.hpp"

namespace r4 {

class BridgeGuard {
 public:
  using Time = std::chrono::steady_clock::time_point;

  // Why datagrams that need a signature do not pass.
  enum class Trouble : std::uint8_t {
    none,
    board_has_no_key,  // the bridge has a key, and the board has none
    key_needed,        // the board has a key, and the bridge has none
  };

  // `keys`: the board's keys with which its hosts sign; at most max_keys. `trusted`: the board
  // obeys every datagram of this transport (its cable), and the bridge is not open to everyone.
  BridgeGuard(const std::vector<Key>& keys, bool trusted);

  void on_board_datagram(const Datagram& datagram, MessageKind kind, Time now);
  // The board's transport is down. The transport may reconnect to another board.
  void on_board_gone() { heard_ = false; }

  Verdict judge(const Datagram& datagram, Time now);
  // Counts a verdict other than authentic. True if the datagram may be answered.
  bool may_answer(Verdict verdict) { return authentication_.rejected(verdict); }

  Trouble trouble() const;

 private:
  std::uint32_t board_ms(Time now) const;

  Authentication authentication_;
  const bool trusted_;
  bool heard_ = false;
  bool asks_ = false;       // the board's newest heartbeat requests signatures
  std::uint32_t t_ms_ = 0;  // the board's clock at told_
  std::optional<Time> told_;
};

}  // namespace r4
