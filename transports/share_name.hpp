// SPDX-License-Identifier: GPL-3.0-or-later
// What a transport is called among the programs of this computer that share it
// (share/shared_carrier.hpp), and how its device is opened.
#pragma once

#include <sys/types.h>

#include <functional>
#include <string>

namespace r4 {

// A group of the system's (group(5)) whose members share the transport, too.
struct ShareGroup {
  std::string name;  // empty: programs of the same user only
  gid_t id = 0;
};

struct ShareName {
  // The same for all programs that mean this transport, and for no other transport. Empty: it is
  // not shared.
  std::string text;
  ShareGroup group{};
  // It is a path, such as the number of a pty: once the device is gone, another one may get it.
  bool is_path = false;
};
// Throws Error if the transport cannot be found.
using FindShareName = std::function<ShareName()>;

// How a transport opens what one program can have at a time: a serial port, the UDP port of hosts.
// The carrier that shares the transport sets it before each open().
struct DeviceClaim {
  // For a program that watches. Another program may take the device, after which this program reads
  // and sends nothing more. The port of hosts is left to programs that control.
  bool yields = false;
  // Takes the device also from a program that yields: at the next opening only.
  bool takes = false;
  // Another program has taken the device, and the transport has closed it.
  std::function<void()> on_taken = nullptr;
};

}  // namespace r4
