// SPDX-License-Identifier: GPL-3.0-or-later
// Transports of a program's own, by calls that may wait. A Board is opened on one with
//
//     auto radio = std::make_shared<Radio>();                              // an OwnTransport
//     r4::Board board(r4::carrier_on(radio));
//     auto bus = std::make_shared<Adapter>();                              // an OwnCanBus
//     r4::Board other(r4::carrier_on(bus, {.node = 3}));
//
// open(), send() and close() are called on one thread that does nothing else, so they may wait while
// the link goes on. A datagram that waits to be sent for 100 ms is dropped, unless it is a stop.
//
// A call that throws (std::exception) takes the transport down: an event reports what it threw,
// close() is called, and open() five times a second until it returns. The first open() is waited
// for: what it throws is thrown where the board is opened. The end of a link waits at most a second
// for these calls.
//
// A class that must not have a thread of its own implements Carrier (carrier.hpp).
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "../carrier.hpp"

namespace r4 {

// Moves whole datagrams of at most max_datagram (1024) bytes, of any content.
class R4LINK_API OwnTransport {
 public:
  // Hands over a datagram that has come. From any thread, at any time: it never waits, and does
  // nothing when the link has ended. Throws Error{usage} for more than max_datagram bytes.
  using Received = std::function<void(std::string_view datagram)>;

  virtual ~OwnTransport() = default;
  // For people.
  virtual std::string name() const = 0;
  virtual void open(Received received) = 0;
  virtual void send(std::string_view datagram) = 0;
  virtual void close() = 0;
};

// A CAN bus that the system does not know: the link does the rest of can:// on it (docs/can.md).
class R4LINK_API OwnCanBus {
 public:
  // Hands over a frame that has come, as above. Not for remote frames, nor for frames that were sent
  // here. Throws Error{usage} for more than 8 bytes of data, of CAN FD 64.
  using Received =
      std::function<void(std::uint32_t id, bool extended, bool fd, std::string_view data)>;

  virtual ~OwnCanBus() = default;
  virtual std::string name() const = 0;
  virtual void open(Received received) = 0;
  virtual void send(std::uint32_t id, bool extended, bool fd, std::string_view data) = 0;
  virtual void close() = 0;
};

struct OwnCanNode {
  int node = 1;      // the board's number, 0-31
  bool fd = false;   // sends CAN FD frames
  bool pack = true;  // sends and gets the packed form; false: text
};

// One transport or bus serves one board at a time.
R4LINK_API CarrierMaker carrier_on(std::shared_ptr<OwnTransport> transport);
// Throws Error{usage} for a node that is out of range.
R4LINK_API CarrierMaker carrier_on(std::shared_ptr<OwnCanBus> bus, const OwnCanNode& node = {});

}  // namespace r4
