// SPDX-License-Identifier: GPL-3.0-or-later
// What a board needs of its end of some transports, besides datagrams. A carrier that has any of it
// is also a BoardEnd; of any other one, board_end_of() gives an end where nothing has to be done.
//
//     UDP     hosts come and go, and send from many places: which of them is in control
//     CAN     datagrams have a packed form
//     pty     stands for the cable of the board's own
#pragma once

#include "r4link/carrier.hpp"

namespace r4 {

class BoardEnd {
 public:
  // That peer is in control. It keeps its number, however many others send, until another peer is
  // held. Where nothing reaches everyone at once, what is sent to everyone goes to it. `everyone`:
  // nobody on this transport is in control.
  virtual void hold(Peer peer) { static_cast<void>(peer); }
  // The host in control is also heard from that peer, which is held besides the first until hold()
  // is called.
  virtual void also_hold(Peer peer) { static_cast<void>(peer); }
  // True if that peer gets what is sent to everyone.
  virtual bool reaches(Peer peer) const { return peer == everyone; }
  // Sends the packed form from now on, or text. Received are both at any time.
  virtual void use_packed_form(bool wanted) { static_cast<void>(wanted); }
  // True for a cable of the board's own, over which it takes the settings of its place.
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
