// SPDX-License-Identifier: GPL-3.0-or-later
// The lock of a serial port: file locks on bytes of its device, so that a program can take the port
// from a hanging program. The locks end with the last descriptor of the opening.
//     bytes   0    1    2    3 …
//     A       A                   yields: it has one byte
//     B            B              has taken the port from A; yields, but not to a yielding program
//     C                 C C C …   has taken the port from B; does not yield: has all later bytes
// A program has lost the port if a byte after its own is locked: A and B here.
#pragma once

#include <sys/types.h>

#include "../share_name.hpp"

namespace r4 {

class PortLock {
 public:
  // False, with errno, if another program has the port and does not yield.
  bool lock(int device, const DeviceClaim& claim);
  bool is_taken() const;
  // True if the port was free, not taken from another program.
  bool is_first() const { return place_ == 0; }

 private:
  int device_ = -1;
  off_t place_ = 0;
};

}  // namespace r4
