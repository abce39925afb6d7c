// SPDX-License-Identifier: GPL-3.0-or-later
// One transport as the application sees it: whole datagrams to one peer or to everyone.
#pragma once

#include <cstddef>
#include <cstdint>

#include "r4link/text.hpp"
#include "r4link/vocabulary.hpp"

namespace r4 {
namespace firmware {

class Port {
 public:
  // Never waits. The port counts what it cannot send.
  virtual void send(Text datagram, Priority priority, Peer peer) = 0;
  // The longest datagram the port carries: 508 on the Giga's WiFi, 1024 elsewhere.
  virtual std::size_t max_size() const = 0;
  // `peer`, in control, keeps its number until another peer is held; everyone: no peer is in
  // control. UDP, which cannot reach everyone at once, sends datagrams for everyone to `peer`.
  virtual void hold(Peer peer) { static_cast<void>(peer); }
  // Also holds `peer`, until hold(): a port may have several paths (session_paths.hpp).
  virtual void also_hold(Peer peer) { static_cast<void>(peer); }
  // True if `peer` receives datagrams for everyone.
  virtual bool reaches(Peer peer) const { return peer == everyone; }
  // `wanted` is the setting `pack`: the port (CAN) sends the packed form if the host uses it.
  virtual void use_packed_form(bool wanted) { static_cast<void>(wanted); }
  // True for a bus (CAN): all programs on the bus receive the port's datagrams, and no program
  // elsewhere receives the datagrams. So a watcher need not prove its address with a LEASE number.
  virtual bool is_bus() const { return false; }
  // True for the board's own cable, from which site settings are accepted (site_settings.hpp).
  virtual bool may_configure() const { return false; }

 protected:
  ~Port() = default;
};

}  // namespace firmware
}  // namespace r4
