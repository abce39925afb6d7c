// SPDX-License-Identifier: GPL-3.0-or-later
// The name under which programs share a transport (share/shared_carrier.hpp), and how to open it.
#pragma once

#include <sys/types.h>

#include <functional>
#include <memory>
#include <string>

namespace r4 {

// A group of the system (group(5)) whose members also share the transport.
struct ShareGroup {
  std::string name;  // empty: programs of the same user only
  gid_t id = 0;
};

struct ShareName {
  // The same for every spelling of a URL.
  std::string text;
  ShareGroup group{};
  // True for a path, such as a pty's. After the device disappears, another device may get the path.
  bool is_path = false;
};
// Throws Error if the transport cannot be found.
using FindShareName = std::function<ShareName()>;

// How to open an exclusive device: a serial port or the UDP port of hosts. Set before each open().
struct DeviceClaim {
  // For a watching program: another program may take the device. Then this program neither reads
  // nor sends. The port of hosts is left to controlling programs.
  bool yields = false;
  // The next opening takes the device from a program that yields.
  bool takes = false;
  // Another program has taken the device, and the transport has closed it.
  std::function<void()> on_taken = nullptr;
};
using Claim = std::shared_ptr<DeviceClaim>;

}  // namespace r4
