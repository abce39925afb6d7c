// SPDX-License-Identifier: GPL-3.0-or-later
// CanSocket on a bus that is exact to the bit: this program has it in place of the kernel's
// (transports/can/can_socket.cpp).
//
//     a socket for what is urgent, one for the rest, few frames each --> the controller --> the bus
//
// As the kernel's, a socket takes no more than its buffer holds, and what is urgent gets to the controller first.
#pragma once

#include <cstddef>

#include "tests/support/can_bus_model.hpp"
#include "transports/file_descriptor.hpp"

namespace r4::test {

struct ControllerOptions {
  CanQueue queue = CanQueue::mailboxes;
  std::size_t room = 3;  // for the frames of the second socket
  std::size_t kept = 1;  // besides, for those of the first
};

// The one interface that there is, whatever its name.
class ModelledController {
 public:
  ModelledController(CanBusModel& bus, const ControllerOptions& options);
  ~ModelledController();
  ModelledController(const ModelledController&) = delete;
  ModelledController& operator=(const ModelledController&) = delete;

  // A program has opened it: the ends of its sockets that are the kernel's.
  void connect(FileDescriptor first, FileDescriptor rest);
  // Takes what the sockets have and the controller has room for.
  void pump();
  std::size_t waiting() const { return bus_.waiting(node_); }
  const ControllerOptions& options() const { return options_; }

 private:
  CanBusModel& bus_;
  const ControllerOptions options_;
  int node_ = 0;
  FileDescriptor first_;
  FileDescriptor rest_;
};

}  // namespace r4::test
