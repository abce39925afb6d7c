// SPDX-License-Identifier: GPL-3.0-or-later
// One transport as the board's application sees it: whole datagrams out, to one peer or to
// everyone.
#pragma once

#include <cstddef>
#include <cstdint>

#include "../protocol/text.hpp"

namespace r4 {
namespace firmware {

// Numbers a peer on a port; 0 is the port's standing audience.
constexpr std::uint32_t everyone = 0;

// What may be lost when a port cannot keep up.
enum class Urgency : std::uint8_t {
  state,   // only the newest matters
  normal,  // heartbeats, answers
};

class Port {
 public:
  // Sends one datagram; never waits. What cannot be sent is the port's to count.
  virtual void send(Text datagram, Urgency urgency, std::uint32_t peer) = 0;
  // The longest datagram the port carries: 508 on the Giga's WiFi, 1024 elsewhere.
  virtual std::size_t max_size() const = 0;
  // That peer is in control: it keeps its number, however many others send, until another is held, and
  // gets what is for everyone where that has no place of its own. everyone: nobody here is any more.
  virtual void hold(std::uint32_t peer) { static_cast<void>(peer); }
  // The setting `pack`: send the packed form from now on, on a port that has one (CAN).
  virtual void use_packed_form(bool wanted) { static_cast<void>(wanted); }
  // Is it a cable of the board's own? Only from there are the settings taken that tell how the board
  // is wired and reached (site_settings.hpp).
  virtual bool may_configure() const { return false; }

 protected:
  ~Port() = default;
};

}  // namespace firmware
}  // namespace r4
