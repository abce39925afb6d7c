// SPDX-License-Identifier: GPL-3.0-or-later
// One transport as the board's application sees it: whole datagrams out, to one peer or to
// everyone.
#pragma once

#include <cstddef>
#include <cstdint>

#include "r4link/text.hpp"
#include "r4link/vocabulary.hpp"

namespace r4 {
namespace firmware {

class Port {
 public:
  // Sends one datagram; never waits. What cannot be sent is the port's to count.
  virtual void send(Text datagram, Priority priority, Peer peer) = 0;
  // The longest datagram the port carries: 508 on the Giga's WiFi, 1024 elsewhere.
  virtual std::size_t max_size() const = 0;
  // That peer is in control. It keeps its number, however many others send, until another peer is held.
  // Where nothing reaches everyone at once (UDP), what is sent to everyone goes to it. `everyone`: nobody on
  // this port is in control any more.
  virtual void hold(Peer peer) { static_cast<void>(peer); }
  // The session has several paths on this port (session_paths.hpp): this peer is held besides those before, until
  // hold() is called.
  virtual void also_hold(Peer peer) { static_cast<void>(peer); }
  // Does that peer get what is sent to everyone?
  virtual bool reaches(Peer peer) const { return peer == everyone; }
  // Send the packed form from now on, on a port that has one (CAN), to a host that does: the setting
  // `pack`, while a host is in control.
  virtual void use_packed_form(bool wanted) { static_cast<void>(wanted); }
  // Is it a bus (CAN), where what it sends is heard by all that are there, and by nobody else? Then who asks
  // for states need not prove where it is.
  virtual bool is_bus() const { return false; }
  // Is it a cable of the board's own? Only from there are the settings taken that tell how the board
  // is wired and reached (site_settings.hpp).
  virtual bool may_configure() const { return false; }

 protected:
  ~Port() = default;
};

}  // namespace firmware
}  // namespace r4
