// SPDX-License-Identifier: GPL-3.0-or-later
// Functions that only boards use. For other carriers these functions do nothing.
#pragma once

#include "r4link/carrier.hpp"

namespace r4 {

class BoardEnd {
 public:
  // Puts `peer` in control; `everyone`: no peer is in control. The peer keeps its number until
  // another peer is held. On UDP, datagrams for `everyone` go to this peer.
  virtual void hold(Peer peer) { static_cast<void>(peer); }
  // Holds a further peer of the controlling host, until hold() is called.
  virtual void also_hold(Peer peer) { static_cast<void>(peer); }
  // True if `peer` gets the datagrams for `everyone`.
  virtual bool reaches(Peer peer) const { return peer == everyone; }
  // Chooses packed form or text for sent datagrams. Both forms are always received.
  virtual void use_packed_form(bool wanted) { static_cast<void>(wanted); }
  // True for the board's own cable, over which the board accepts keys, passwords and its node.
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
