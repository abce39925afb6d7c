// SPDX-License-Identifier: GPL-3.0-or-later
// Transports of your own, with functions that may block:
//     auto radio = std::make_shared<Radio>();                              // an OwnTransport
//     r4::Board board(r4::carrier_on(radio));
//     auto bus = std::make_shared<Adapter>();                              // an OwnCanBus
//     r4::Board other(r4::carrier_on(bus, {.node = 3}));
//
// open(), send() and close() are called on a separate thread, so they may wait while the link
// continues. A datagram that waits for 100 ms is dropped, except a stop.
//
// If a function throws a std::exception, the transport is down: an event reports it, close() is
// called, and then open() five times a second until it succeeds. Opening a board waits for the
// first open(), without limit, and throws its exception. The end of a link waits at most 1 s for
// these functions. A class without a separate thread implements Carrier (carrier.hpp).
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "../carrier.hpp"

namespace r4 {

// Moves whole datagrams of at most max_datagram (1024) bytes with any content.
class R4LINK_API OwnTransport {
 public:
  // Call Received for each received datagram, on any thread and at any time. Never waits. No effect
  // after the next open() or the link's end. Throws Error{usage} above max_datagram bytes.
  using Received = std::function<void(std::string_view datagram)>;

  virtual ~OwnTransport() = default;
  // The name for people.
  virtual std::string name() const = 0;
  virtual void open(Received received) = 0;
  virtual void send(std::string_view datagram) = 0;
  virtual void close() = 0;
};

// A CAN bus that the system does not offer. The link uses it as can:// (docs/reference/can.md).
class R4LINK_API OwnCanBus {
 public:
  // Call Received for each received frame, as OwnTransport::Received, but not for remote frames and
  // own frames. Throws Error{usage} for more than 8 bytes of data, or 64 with CAN FD.
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
  bool pack = true;  // sends and receives the packed form; false: text
};

// One transport or bus serves one board at a time. carrier_on() does not block.
R4LINK_API CarrierMaker carrier_on(std::shared_ptr<OwnTransport> transport);
// Throws Error{usage} for a node outside 0-31.
R4LINK_API CarrierMaker carrier_on(std::shared_ptr<OwnCanBus> bus, const OwnCanNode& node = {});

}  // namespace r4
