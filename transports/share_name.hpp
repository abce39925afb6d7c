// SPDX-License-Identifier: GPL-3.0-or-later
// The name by which the programs of this computer share a transport (share/shared_carrier.hpp), and
// how its device is opened.
#pragma once

#include <sys/types.h>

#include <functional>
#include <memory>
#include <string>

namespace r4 {

// A group of the system (group(5)) whose members share the transport, too.
struct ShareGroup {
  std::string name;  // empty: programs of the same user only
  gid_t id = 0;
};

struct ShareName {
  // Each transport has one text, however its URL is written.
  std::string text;
  ShareGroup group{};
  // The text is a path, such as that of a pty: once the device is gone, another device may get it.
  bool is_path = false;
};
// Throws Error if the transport cannot be found.
using FindShareName = std::function<ShareName()>;

// How a transport opens a device that one program can have at a time: a serial port, the UDP port
// of hosts. The carrier that shares the transport sets it before each open().
struct DeviceClaim {
  // For a program that watches. Another program may take the device, after which this program reads
  // and sends nothing more. The port of hosts is left to programs that control.
  bool yields = false;
  // Takes the device also from a program that yields: at the next opening only.
  bool takes = false;
  // Another program has taken the device, and the transport has closed it.
  std::function<void()> on_taken = nullptr;
};
using Claim = std::shared_ptr<DeviceClaim>;

}  // namespace r4
