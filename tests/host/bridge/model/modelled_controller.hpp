// SPDX-License-Identifier: GPL-3.0-or-later
// CanSocket on a bus that is exact to the bit. In this program this CanSocket replaces the kernel's
// socket (transports/can/can_socket.cpp).
//
//     a socket for urgent frames, a socket for the other frames --> the controller --> the bus
//
// As in the kernel, a socket accepts no more frames than its small buffer holds, and urgent frames
// reach the controller first.
#pragma once

#include <cstddef>

#include "tests/support/can_bus_model.hpp"
#include "transports/file_descriptor.hpp"

namespace r4::test {

struct ControllerOptions {
  CanQueue queue = CanQueue::mailboxes;
  std::size_t room = 3;  // for frames of the second socket
  std::size_t kept = 1;  // additional room, only for frames of the first socket
};

// The only CAN interface, whatever its name.
class ModelledController {
 public:
  ModelledController(CanBusModel& bus, const ControllerOptions& options);
  ~ModelledController();
  ModelledController(const ModelledController&) = delete;
  ModelledController& operator=(const ModelledController&) = delete;

  // Connects a program that has opened the interface. The parameters are the kernel's ends of its
  // sockets.
  void connect(FileDescriptor first, FileDescriptor rest);
  // Moves frames from the sockets to the controller while the controller has room.
  void pump();
  std::size_t waiting() const { return bus_.waiting(node_); }

 private:
  CanBusModel& bus_;
  const ControllerOptions options_;
  int node_ = 0;
  FileDescriptor first_;
  FileDescriptor rest_;
};

}  // namespace r4::test
