// SPDX-License-Identifier: GPL-3.0-or-later
// What a wire is called that the programs of a machine share (share/shared_carrier.hpp), and how
// its device is opened.
#pragma once

#include <sys/types.h>

#include <functional>
#include <string>

namespace r4 {

// Whose programs share it, besides those of the same user.
struct ShareGroup {
  std::string name;  // empty: nobody's
  gid_t id = 0;
};

struct SharedWire {
  // The same for all who mean it, and for nobody else. Empty: it is not shared.
  std::string name;
  ShareGroup group{};
  // The name is a place, as the number of a pty: when the device goes, another may be next there.
  bool is_place = false;
};
// Throws Error where it is not to be found.
using FindWire = std::function<SharedWire()>;

// How a transport opens a device that one program can have open at a time (a serial port). The one
// who shares the wire sets it before each open().
struct DeviceClaim {
  // Another program may take the device, after which this program reads and sends nothing more.
  bool yields = false;
  // Takes the device also from a program that yields: at the next opening only.
  bool takes = false;
  // Another program has taken the device, and the transport has closed it.
  std::function<void()> on_taken = nullptr;
};

}  // namespace r4
