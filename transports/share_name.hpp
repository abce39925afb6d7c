// SPDX-License-Identifier: GPL-3.0-or-later
// What a transport is called among the programs of this computer that share it
// (share/shared_carrier.hpp).
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

}  // namespace r4
