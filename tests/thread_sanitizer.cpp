// SPDX-License-Identifier: GPL-3.0-or-later
// Part of r4 under ThreadSanitizer. GCC 12's runtime makes a thread's list of deferred signals at the thread's first call
// that waits, and loses a signal that comes meanwhile: SigCtx() in libsanitizer/tsan/tsan_interceptors_posix.cpp then
// makes two lists, and keeps the empty one. So the first wait is here, before r4 takes signals.
#include <unistd.h>

namespace {

const int first_wait = ::usleep(1);

}  // namespace
