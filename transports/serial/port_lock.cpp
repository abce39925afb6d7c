// SPDX-License-Identifier: GPL-3.0-or-later
#include "port_lock.hpp"

#include <fcntl.h>
#include <sys/file.h>

#include <cerrno>

namespace r4 {
namespace {

struct flock bytes_from(off_t first, off_t count) {
  struct flock bytes {};
  bytes.l_type = F_WRLCK;
  bytes.l_whence = SEEK_SET;
  bytes.l_start = first;
  bytes.l_len = count;  // 0: all following bytes
  return bytes;
}

// A lock of another opening at or after that byte. Without such a lock, the type is F_UNLCK.
struct flock other_from(int device, off_t first) {
  struct flock bytes = bytes_from(first, 0);
  if (::fcntl(device, F_OFD_GETLK, &bytes) != 0) bytes.l_type = F_UNLCK;
  return bytes;
}

}  // namespace

bool PortLock::lock(int device, const DeviceClaim& claim) {
  // Foreign programs lock the whole device.
  if (::flock(device, LOCK_SH | LOCK_NB) != 0) return false;
  off_t place = 0;
  while (true) {
    const struct flock other = other_from(device, place);
    if (other.l_type == F_UNLCK) break;
    // A yielding program takes the port from one program only, or two programs would alternate.
    if (!claim.takes || other.l_len == 0 || (claim.yields && place != 0)) {
      errno = EWOULDBLOCK;
      return false;
    }
    place = other.l_start + 1;
  }
  struct flock bytes = bytes_from(place, claim.yields ? 1 : 0);
  if (::fcntl(device, F_OFD_SETLK, &bytes) != 0) return false;
  device_ = device;
  place_ = place;
  return true;
}

bool PortLock::is_taken() const { return other_from(device_, place_ + 1).l_type != F_UNLCK; }

}  // namespace r4
