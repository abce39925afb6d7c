// SPDX-License-Identifier: GPL-3.0-or-later
// Who has a serial port: locks on the bytes of its device, which has none to read at these places, so that a program
// may take it from one that hangs. They go with the last descriptor of the opening.
//
//     bytes   0    1    2    3 …
//     A       A                   yields: it has one byte
//     B            B              has taken it from A, and yields, but not to one that yields
//     C                 C C C …   has taken it from B: with all that follow it yields to nobody
//
// Whoever finds a byte behind its own locked has lost the port: A and B here.
#pragma once

#include <sys/types.h>

#include "../share_name.hpp"

namespace r4 {

class PortLock {
 public:
  // False, with errno, if other programs have it and do not let it go.
  bool lock(int device, const DeviceClaim& claim);
  // Another program has taken it from this one.
  bool is_taken() const;
  // Nobody has had it before.
  bool is_first() const { return place_ == 0; }

 private:
  int device_ = -1;
  off_t place_ = 0;
};

}  // namespace r4
