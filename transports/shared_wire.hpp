// SPDX-License-Identifier: GPL-3.0-or-later
// What a wire is called that the programs of a machine share (share/shared_carrier.hpp).
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

}  // namespace r4
