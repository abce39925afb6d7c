// SPDX-License-Identifier: GPL-3.0-or-later
// Functions of a transport that only boards use. A carrier with such a function is also a BoardEnd.
// For any other carrier board_end_of() returns an end whose functions do nothing.
//
//     UDP     hosts send from many peers: which peers are in control
//     CAN     datagrams have a packed form
//     pty     is the board's own cable
#pragma once

#include "r4link/carrier.hpp"

namespace r4 {

class BoardEnd {
 public:
  // That peer is in control: it keeps its number, however many other peers send, until another peer
  // is held. On UDP, datagrams for `everyone` go to it. `everyone`: no peer is in control.
  virtual void hold(Peer peer) { static_cast<void>(peer); }
  // The host in control is also heard from that peer, which is held besides the first until hold()
  // is called.
  virtual void also_hold(Peer peer) { static_cast<void>(peer); }
  // True if that peer gets the datagrams for `everyone`.
  virtual bool reaches(Peer peer) const { return peer == everyone; }
  // Sends the packed form from now on, or text. Both forms are always received.
  virtual void use_packed_form(bool wanted) { static_cast<void>(wanted); }
  // True for the board's own cable, over which the board takes keys, passwords and its node.
  virtual bool is_own_cable() const { return false; }

 protected:
  ~BoardEnd() = default;
};

inline BoardEnd& board_end_of(Carrier& carrier) {
  static class Plain final : public BoardEnd {
  } plain;
  auto* const own = dynamic_cast<BoardEnd*>(&carrier);
  return own != nullptr ? *own : plain;
}

}  // namespace r4
